"""Between launches: the order parameter of each world in motion, and which interface it has come to."""

import functools
from typing import Any

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.functions import compiled, function_from_text
from otwarp.kernels.core.medium import thermal_energy_of
from otwarp.kernels.core.packed import point_of, power_of, radius_of
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.rounding import PRECISION
from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData, WorldNow, world_row
from otwarp.kernels.core.worlds import living_world
from otwarp.kernels.drivers.episodes import WorldFunction, parameters_from
from otwarp.kernels.optics.potentials import trap_energy_term
from otwarp.kernels.optics.readout import sphere_position_term
from otwarp.kernels.optics.trap_command import anchor_of, trap_command_term
from otwarp.kernels.optics.traps import trap_force_term

RETURNED = wp.constant(2)
"""Code of a world whose order parameter is below its lower interface."""

ADVANCED = wp.constant(3)
"""Code of a world whose order parameter has come to its upper interface."""

NO_NUMBER = wp.constant(4)
"""Code of a world whose order parameter is NaN."""


SAME = wp.constant(1e-10)
"""Squared distance [µm²] below which two offsets in a body are one sphere's."""


def distance_term(f: Features) -> wp.Function:
    """`(model, world, trap, away, power, relative) -> float`: how far a held sphere is from its trap."""

    @wp.func
    def distance(model: ModelData, world: int, trap: int, away: wp.vec3, power: float, relative: float) -> float:
        """Distance [µm] of a sphere `away` from the equilibrium point, or over that at which it has escaped."""
        far = wp.length(away)
        if relative != 0.0:
            far = far / model.traps.held_range[world_row(model.traps.held_range.shape[0], world), trap]
        return far

    return distance


def energy_term(f: Features) -> wp.Function:
    """`(model, world, trap, away, power, relative) -> float`: the potential energy of a held sphere in its trap."""
    prepare, energy_of = trap_force_term(f.trap_models).prepare, trap_energy_term(f.trap_models)

    @wp.func
    def energy(model: ModelData, world: int, trap: int, away: wp.vec3, power: float, relative: float) -> float:
        """Energy [k_B T] of a sphere `away` [µm] from the equilibrium point of a trap of `power` [mW], there 0."""
        b = model.traps.held_body[trap]
        radius = float(0.0)
        for i in range(model.body.trapped_start[b], model.body.trapped_start[b + 1]):
            sphere = model.body.trapped[i]
            if wp.length_sq(point_of(sphere) - model.traps.held_offset[trap]) < SAME:
                radius = radius_of(sphere)
        law = prepare(model.traps, world, trap, radius, 0)
        return power * energy_of(law, away) / thermal_energy_of(model, world)

    return energy


HELD = {"distance": distance_term, "energy": energy_term}
"""Order parameters of held spheres by name."""


def held_term(f: Features, name: str) -> wp.Function:
    """`(model, control, state, world, step, only, relative) -> float`: the largest of an order parameter of `HELD`."""
    trap_command, sphere_position = trap_command_term(f), sphere_position_term(f)
    value_of = HELD[name](f)

    @wp.func
    def largest_of(
        model: ModelData, control: ControlData, state: StateData, world: int, step: wp.int64, only: int, relative: float
    ) -> float:
        """Largest of all held spheres, or that of trap `only` unless it is < 0; NaN where none is held."""
        largest = float(wp.nan)
        time = wp.float64(step) * model.time_step
        for trap in range(model.traps.axis.shape[0]):
            b = model.traps.held_body[trap]
            if b >= 0 and (only < 0 or only == trap):
                command = trap_command(model, control, state, world, trap, time)
                away = sphere_position(model, state, world, b, model.traps.held_offset[trap])
                away -= anchor_of(model, trap, command)
                if wp.static(f.periodic):
                    away = nearest(model.period, away)
                value = value_of(model, world, trap, away, power_of(command), relative)
                largest = wp.where(wp.isnan(largest), value, wp.max(largest, value))
        return largest

    return largest_of


def order_term(function: WorldFunction) -> wp.Function:
    """`(now, values) -> float`: a function of a world at a moment, with its parameters from a row of `values`."""
    text = (
        "def order_of(now: WorldNow, values: Values) -> float:\n"
        '    """The order parameter of a world."""\n'
        "    row = world_row(values.shape[0], now.world)\n"
        f"    return order(now{parameters_from(function, 0)})\n"
    )
    names: dict[str, Any] = {
        "WorldNow": WorldNow,
        "Values": wp.array2d(dtype=wp.float32),
        "vec3": wp.vec3,
        "float": wp.float32,
        "world_row": world_row,
        "order": compiled(function.function, PRECISION, "order", (wp.float32,), "float"),
    }
    return wp.func(function_from_text("order_of", text, names))


@functools.lru_cache(maxsize=64)
def interface_kernel(f: Features | None, asked: WorldFunction | str) -> wp.Kernel:
    """Kernel over the places of the list of worlds in motion: read the order parameter, and end who is at an interface.

    Args:
        f: Features of the scene for an order parameter of held spheres; None for another function.
        asked: The order parameter: its name in `HELD`, or `(now: WorldNow, *parameters) -> float`.
    """
    held = f is not None and isinstance(asked, str)
    order_of = held_term(f, asked) if f is not None and isinstance(asked, str) else None
    if isinstance(asked, WorldFunction):
        order_of = order_term(asked)

    @wp.kernel(module="unique", enable_backward=False)
    def look(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData,
        values: wp.array2d(dtype=wp.float32), low: wp.array(dtype=wp.float32), high: wp.array(dtype=wp.float32),
        order: wp.array(dtype=wp.float32), peak: wp.array(dtype=wp.float32),
    ):  # fmt: skip
        """Write the order parameter of each world in motion, the largest so far, and its code in `done`.

        Worlds that have ended otherwise keep both; `low` and `high` (worlds) are their interfaces.
        """
        world = living_world(model, wp.tid())
        if world < 0:
            return
        if model.worlds[0].done[world] != 0:
            return
        step = model.worlds[0].step[world]
        value = float(0.0)
        if wp.static(held):
            value = order_of(model, control, state, world, step, int(values[0, 0]), values[0, 1])
        else:
            time = wp.float32(wp.float64(step) * model.time_step)
            value = order_of(WorldNow(world, step, time, state, readout), values)
        order[world] = value
        peak[world] = wp.max(peak[world], value)
        if wp.isnan(value):
            model.worlds[0].done[world] = NO_NUMBER
        elif value >= high[world]:
            model.worlds[0].done[world] = ADVANCED
        elif value < low[world]:
            model.worlds[0].done[world] = RETURNED

    return look
