"""Inlets in the drivers: a cell that has left comes in again where it overlaps nothing, at once or in a later step.

Until it finds room it goes on outside as any body does. Bodies of a world come in one after the other, by index, so
that each sees those before it.
"""

import warp as wp

from otwarp.kernels.contact.obstacles import distance_term, moving_pose, still_pose
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import distance_of
from otwarp.kernels.core.periodic import kept_in_cell, nearest
from otwarp.kernels.core.recycling import TRIES, entry_place, has_left
from otwarp.kernels.core.types import ModelData, ReadoutData, StateData
from otwarp.kernels.core.worlds import number_term


@wp.func
def collides(model: ModelData, b: int) -> bool:
    """Whether a body has spheres that contacts act on, so that it must come in clear of all others."""
    return model.contact.start[b + 1] > model.contact.start[b]


def count_entry_term(f: Features) -> wp.Function:
    """`(state, readout, world, b)`: tell that a body has come in."""

    @wp.func
    def count_entry(state: StateData, readout: ReadoutData, world: int, b: int):
        """Count the entry; how often it has crossed a period counts from there."""
        readout.entries[world, b] = readout.entries[world, b] + 1
        if wp.static(f.periodic):
            state.image[world, b] = wp.vec3i(0, 0, 0)

    return count_entry


def kept_in_space_term(f: Features) -> wp.Function:
    """`(model, state, readout, world, b, position, step) -> vec3` for bodies that touch nothing."""
    number, count_entry = number_term(f), count_entry_term(f)

    @wp.func
    def kept_in_space(
        model: ModelData, state: StateData, readout: ReadoutData, world: int, b: int, position: wp.vec3, step: wp.int64
    ) -> wp.vec3:
        """Where body b [µm] is when the step arrives at `step`: in the periodic cell; in the inlet if it has left."""
        place = position
        if wp.static(f.periodic):
            place = kept_in_cell(model, state, world, b, place)
        if wp.static(f.inlet):
            if has_left(model, b, place):
                place = entry_place(model, number(model, world), b, step, 0)
                count_entry(state, readout, world, b)
        return place

    return kept_in_space


def clear_of_obstacles_term(f: Features) -> wp.Function:
    """`(model, place, radius, time) -> bool`: whether a ball touches no obstacle."""
    pose_at = moving_pose if f.moving_obstacles else still_pose
    distance_to = distance_term(f.obstacles)

    @wp.func
    def clear_of_obstacles(model: ModelData, place: wp.vec3, radius: float, time: wp.float64) -> bool:
        """Whether no obstacle is within `radius` [µm] of `place` [µm] at a time [s]."""
        clear = bool(True)
        for o in range(model.obstacles.shape.shape[0]):
            wall = pose_at(model.obstacles, o, time)
            away = place - wall.position
            if wp.static(f.periodic):
                away = nearest(model.period, away)
            if wp.length(away) < radius + model.obstacles.bound[o]:
                local = wp.quat_rotate_inv(wall.rotation, away)
                clear = distance_of(distance_to(model.obstacles, o, local, radius)) >= radius
                if not clear:
                    break
        return clear

    return clear_of_obstacles


def others_clear_term(f: Features) -> wp.Function:
    """`(model, world, b, there, position) -> bool`: whether body b at `there` overlaps none of those at `position`."""

    @wp.func
    def others_clear(model: ModelData, world: int, b: int, there: wp.vec3, position: wp.array(dtype=wp.vec3)) -> bool:
        """Whether the balls about the bodies keep apart; `position` (B) [µm]."""
        clear = bool(True)
        for a in range(model.bodies):
            if a != b and collides(model, a):
                away = there - position[a]
                if wp.static(f.periodic):
                    away = nearest(model.period, away)
                clear = wp.length(away) >= model.body.bound[a] + model.body.bound[b]
                if not clear:
                    break
        return clear

    return others_clear


def let_in_term(f: Features, clear_of_others: wp.Function, others: type) -> wp.Function:
    """`(model, world, b, position, where, step) -> (place, entered)` of body b, which has left and is at `position`.

    Args:
        clear_of_others: `(model, world, b, there, where) -> bool`.
        others: Type of `where`, which knows the places of all bodies of the world.
    """
    number = number_term(f)
    clear_of_obstacles = clear_of_obstacles_term(f) if f.obstacles else None

    @wp.func
    def let_in(model: ModelData, world: int, b: int, position: wp.vec3, where: others, step: wp.int64):
        """The first free place of a step's tries [µm] and true, or where it is and false."""
        place = position
        entered = bool(False)
        attempt = int(0)
        while attempt < TRIES and not entered:
            there = entry_place(model, number(model, world), b, step, attempt)
            entered = bool(True)
            if wp.static(f.contacts):
                if collides(model, b):
                    if wp.static(bool(f.obstacles)):
                        time = wp.float64(step) * model.time_step
                        entered = clear_of_obstacles(model, there, model.body.bound[b], time)
                    if entered:
                        entered = clear_of_others(model, world, b, there, where)
            if entered:
                place = there
            attempt += 1
        return place, entered

    return let_in


def let_all_in_term(f: Features) -> wp.Function:
    """`(model, state, readout, world, position, step) -> int`: how many bodies of a world that have left come in."""
    let_in = let_in_term(f, others_clear_term(f), wp.array(dtype=wp.vec3))
    count_entry = count_entry_term(f)

    @wp.func
    def let_all_in(
        model: ModelData, state: StateData, readout: ReadoutData, world: int, position: wp.array(dtype=wp.vec3),
        step: wp.int64,
    ) -> int:  # fmt: skip
        """Write the places [µm] of the bodies that come in as the step arrives at `step` into `position` (B)."""
        count = int(0)
        for b in range(model.bodies):
            if has_left(model, b, position[b]):
                place, entered = let_in(model, world, b, position[b], position, step)
                if entered:
                    position[b] = place
                    count_entry(state, readout, world, b)
                    count += 1
        return count

    return let_all_in
