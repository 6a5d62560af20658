"""What a step may bring to touch: how far free moves go, what a gap does in between, elements before obstacles."""

import warp as wp

from otwarp.kernels.contact.contact import Contact, along
from otwarp.kernels.contact.detect_walls import touch_wall_term
from otwarp.kernels.contact.excursion import excursion_term, kept_reach, obstacle_name
from otwarp.kernels.contact.obstacles import distance_term, moving_pose, still_pose
from otwarp.kernels.contact.travel import lift_of, thermal_reach, wander_of
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import radius_of
from otwarp.kernels.core.periodic import image_shift
from otwarp.kernels.core.types import ModelData, Move, Pose, ReadoutData
from otwarp.kernels.drivers.grid.data import GridData, lifts_noise, own_term

PUSHED = wp.constant(0.1)
"""How far others may push an element beyond its own free move in one step, relative to its radius."""


def free_opening_term(f: Features) -> wp.Function:
    """`(grid, world, c) -> opening` of a contact's gap by the free moves of this step [µm]."""

    @wp.func
    def free_move_of(grid: GridData, world: int, b: int) -> Move:
        """Free displacement [µm] and rotation [rad] of body b in this step."""
        move = Move(grid.linear[world, b], wp.vec3(0.0))
        if wp.static(f.rigid):
            move.angular = grid.angular[world, b]
        return move

    @wp.func
    def free_opening(grid: GridData, world: int, c: Contact) -> float:
        """Opening [µm] by the free moves of both partners, less the obstacle's own motion, and by the lift so far."""
        total = along(free_move_of(grid, world, c.a), c.arm_a, c.normal) - wp.dot(c.drift, c.normal) + c.lift
        if c.b >= 0:
            total -= along(free_move_of(grid, world, c.b), c.arm_b, c.normal)
        return total

    return free_opening


def travel_term(f: Features) -> wp.Function:
    """`(model, grid, world, b) -> travel`: how far any point of a body moves freely in this step at most [µm]."""

    @wp.func
    def travel(model: ModelData, grid: GridData, world: int, b: int) -> float:
        """Bound [µm] of the displacement of the body's outermost point: translation, and rotation times its radius."""
        far = wp.length(grid.linear[world, b])
        if wp.static(f.rigid):
            far += wp.length(grid.angular[world, b]) * model.body.bound[b]
        return far

    return travel


def drawn_term(f: Features) -> wp.Function:
    """`(model, grid, world, c, first, second, step) -> Contact`: a contact with what its gap does in this step.

    `first` and `second` name the partners, see `excursion_term`. The sweeps are called for if it carries a force, or if
    the free moves of the step close it or may touch in between; another one, which only the motion of its neighbours
    may close, waits in the list.
    """
    free_opening = free_opening_term(f)
    excursion = excursion_term(f)
    own = own_term(f)

    @wp.func
    def noise_of(grid: GridData, world: int, b: int) -> Move:
        """Move [µm, rad] of body b by noise alone."""
        move = Move(grid.linear[world, b] - grid.drift[world, b], wp.vec3(0.0))
        if wp.static(f.rigid):
            move.angular = grid.angular[world, b] - grid.turning[world, b]
        return move

    @wp.func
    def drawn(
        model: ModelData, grid: GridData, world: int, c: Contact, first: int, second: int, step: wp.int64
    ) -> Contact:
        """The contact with its excursion, its first guess the force at the start."""
        opening = free_opening(grid, world, c)
        if wp.static(lifts_noise(f)):
            c.lift = lift_of(c, noise_of(grid, world, c.a), noise_of(grid, world, wp.max(c.b, 0)))
            opening += c.lift
        c = excursion(model, world, c, opening, first, second, 0, step)
        if c.force != 0.0 or c.overlap > 0.0 or kept_reach(c, opening + c.give * c.floor) > 0.0:
            grid.touching[own(world)] = 1
        c.load = c.force
        return c

    return drawn


@wp.struct
class WallHit:
    """An element before an obstacle: pose of the obstacle, of the body beside its image, and how far apart they are."""

    wall: Pose
    pose: Pose
    local: wp.vec3
    """The sphere's centre in the obstacle's frame [µm]."""
    hit: wp.vec4
    """Normal there, and distance of the centre from the surface [µm]."""


def wall_reach_term(f: Features) -> wp.Function:
    """`(model, grid, world, a, radius) -> float`: up to where a sphere of body a may be in this step [µm]."""
    travel = travel_term(f)

    @wp.func
    def wall_reach(model: ModelData, grid: GridData, world: int, a: int, radius: float) -> float:
        """Radius and what its moves in this step are large enough for [µm]."""
        beyond = PUSHED * radius
        if wp.static(f.brownian):
            beyond = wp.max(beyond, thermal_reach(wander_of(model, world, a)))
        far = radius + wp.min(grid.near.adhesion + travel(model, grid, world, a) + beyond, grid.near.reach)
        if wp.static(f.moving_obstacles):
            far = radius + grid.near.reach
        return far

    return wall_reach


def wall_hit_term(f: Features) -> wp.Function:
    """`(model, o, pose, arm, far, step) -> WallHit` of the sphere at an arm of a body before obstacle o."""
    pose_at = moving_pose if f.moving_obstacles else still_pose
    distance_to = distance_term(f.obstacles)

    @wp.func
    def wall_hit(model: ModelData, o: int, pose: Pose, arm: wp.vec3, far: float, step: wp.int64) -> WallHit:
        """How far it is away if that is less than `far` [µm], else `far` or more."""
        out = WallHit()
        out.wall = pose_at(model.obstacles, o, wp.float64(step) * model.time_step)
        out.pose = pose
        out.hit = wp.vec4(0.0, 0.0, 0.0, far)
        if wp.static(f.periodic):
            out.pose.position = pose.position + image_shift(model.period, pose.position - out.wall.position)
        away = out.pose.position + arm - out.wall.position
        if wp.length(away) < far + model.obstacles.bound[o]:
            out.local = wp.quat_rotate_inv(out.wall.rotation, away)
            out.hit = distance_to(model.obstacles, o, out.local, far)
        return out

    return wall_hit


def wall_contact_term(f: Features) -> wp.Function:
    """`(model, readout, grid, world, a, e, o, arm, at, step) -> Contact` of sphere e with an obstacle that it is at."""
    touch_wall = touch_wall_term(f)
    drawn = drawn_term(f)

    @wp.func
    def wall_contact(
        model: ModelData, readout: ReadoutData, grid: GridData, world: int, a: int, e: int, o: int, arm: wp.vec3,
        at: WallHit, step: wp.int64,
    ) -> Contact:  # fmt: skip
        """The contact of sphere e with obstacle o."""
        later = at.wall
        if wp.static(f.moving_obstacles):
            later = moving_pose(model.obstacles, o, wp.float64(step) * model.time_step + model.time_step)
        radius = radius_of(model.contact.sphere[e])
        c = touch_wall(model, readout, world, a, o, at.pose, at.wall, later, arm, radius, at.local, at.hit, step)
        return drawn(model, grid, world, c, e, obstacle_name(o), step)

    return wall_contact
