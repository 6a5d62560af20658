"""The body driver: one thread per body and step, neighbours from a hash grid, for scenes with many touching bodies.

A step is three kernels around one grid build: `advance` (free displacement), `touch` (contact forces from the free
displacements of both partners) and `commit` (apply, and place the spheres for the next build). All steps and worlds
use the same launches, so a step is captured in a graph; the step counter lives in device memory.
"""

import warp as wp

from otwarp.kernels.body import free_move_term
from otwarp.kernels.contact import NO_CONTACT, Contact, along
from otwarp.kernels.detect import new_contact_term
from otwarp.kernels.drivers import escape_term
from otwarp.kernels.faults import OVERLAP_LIMIT, Fault, finite, raise_fault
from otwarp.kernels.features import Features
from otwarp.kernels.obstacles import distance_term, moving_pose, still_pose
from otwarp.kernels.rotation import rotate_by
from otwarp.kernels.traps import commanded_animated, commanded_still, limited_focus
from otwarp.kernels.types import ControlData, ModelData, Move, Pose, ReadoutData, StateData

SHARE = wp.constant(4.0)
"""How many stiff contacts of one body are resolved together without overshoot.

All contacts of a step are solved at once from the free displacements; each takes the share that would leave room for
this many along the same direction. Both partners compute the same force, so the third law holds to rounding."""


@wp.struct
class GridData:
    """Scratch of the body driver."""

    clock: wp.array(dtype=wp.int64)  # (1) step counter
    linear: wp.array2d(dtype=wp.vec3)  # (W, B) free displacement [µm]
    angular: wp.array2d(dtype=wp.vec3)  # (W, B) free rotation [rad]
    push_linear: wp.array2d(dtype=wp.vec3)  # (W, B) displacement by contact
    push_angular: wp.array2d(dtype=wp.vec3)
    centre: wp.array(dtype=wp.vec3)  # (W·C) centres of the colliding spheres [µm]
    group: wp.array(dtype=wp.int32)  # (W·C) world of each
    largest: float  # radius of the largest colliding sphere [µm]
    reach: float  # longest range of adhesion [µm]


def make_advance(f: Features) -> wp.Kernel:
    """Kernel over (world, body): free displacement of this step."""
    free_move = free_move_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def advance(model: ModelData, control: ControlData, state: StateData, grid: GridData):
        world, b = wp.tid()
        step = grid.clock[0]
        pose = Pose(state.position[world, b], wp.quat_identity())
        if wp.static(f.rigid):
            pose.rotation = state.orientation[world, b]
        move = free_move(model, control, state, world, b, pose, step, wp.float64(step) * model.time_step)
        grid.linear[world, b] = move.linear
        if wp.static(f.rigid):
            grid.angular[world, b] = move.angular

    return advance


def body_pose_term(f: Features) -> wp.Function:
    """`(state, world, b) -> Pose`."""

    @wp.func
    def body_pose(state: StateData, world: int, b: int) -> Pose:
        pose = Pose(state.position[world, b], wp.quat_identity())
        if wp.static(f.rigid):
            pose.rotation = state.orientation[world, b]
        return pose

    return body_pose


def free_opening_term(f: Features) -> wp.Function:
    """`(grid, world, c) -> opening` of a contact's gap by the free displacements of this step [µm]."""

    @wp.func
    def free_move_of(grid: GridData, world: int, b: int) -> Move:
        move = Move(grid.linear[world, b], wp.vec3(0.0))
        if wp.static(f.rigid):
            move.angular = grid.angular[world, b]
        return move

    @wp.func
    def free_opening(grid: GridData, world: int, c: Contact) -> float:
        opening = along(free_move_of(grid, world, c.a), c.arm_a, c.normal) - c.drift
        if c.b >= 0:
            opening -= along(free_move_of(grid, world, c.b), c.arm_b, c.normal)
        return opening

    return free_opening


@wp.struct
class Push:
    """Sum over the contacts of one body: displacement, net force [pN], sum of normal forces [pN]."""

    linear: wp.vec3
    angular: wp.vec3
    force: wp.vec3
    load: float


@wp.func
def add_contact(total: Push, c: Contact, opening: float) -> Push:
    """Solve one contact for its share and add what it does to body a."""
    load = wp.max((c.force - c.stiffness * opening) / (1.0 + SHARE * c.stiffness * c.give), c.floor)
    total.linear += load * c.response_a.linear
    total.angular += load * c.response_a.angular
    total.force += load * c.normal
    total.load += wp.abs(load)
    return total


def neighbour_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, table, world, a, pose, total, step) -> Push` by the spheres of other bodies."""
    new_contact = new_contact_term(f)
    free_opening = free_opening_term(f)
    body_pose = body_pose_term(f)

    @wp.func
    def neighbours(
        model: ModelData,
        state: StateData,
        readout: ReadoutData,
        grid: GridData,
        table: wp.uint64,
        world: int,
        a: int,
        pose: Pose,
        total: Push,
        step: wp.int64,
    ) -> Push:
        spheres = model.contact.sphere.shape[0]
        for i in range(model.contact.start[a], model.contact.start[a + 1]):
            here = grid.centre[world * spheres + i]
            ri = model.contact.sphere[i][3]
            for other in wp.hash_grid_query(table, here, ri + grid.largest + grid.reach, world):
                j = other - world * spheres
                b = model.contact.body[j]
                way = here - grid.centre[other]
                distance = wp.length(way)
                rj = model.contact.sphere[j][3]
                overlap = ri + rj - distance
                if b != a and overlap > -grid.reach and distance > 0.0:
                    if overlap > OVERLAP_LIMIT * wp.min(ri, rj):
                        raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
                    pose_b = body_pose(state, world, b)
                    arm_a = here - pose.position
                    arm_b = grid.centre[other] - pose_b.position
                    c = new_contact(
                        model, world, a, b, pose, pose_b, arm_a, arm_b, way / distance, ri * rj / (ri + rj), overlap
                    )
                    total = add_contact(total, c, free_opening(grid, world, c))
        return total

    return neighbours


def wall_term(f: Features) -> wp.Function:
    """`(model, readout, grid, world, a, pose, total, step) -> Push` by the obstacles."""
    new_contact = new_contact_term(f)
    free_opening = free_opening_term(f)
    pose_at = moving_pose if f.moving_obstacles else still_pose
    distance_to = distance_term(f.obstacles)

    @wp.func
    def walls(
        model: ModelData,
        readout: ReadoutData,
        grid: GridData,
        world: int,
        a: int,
        pose: Pose,
        total: Push,
        step: wp.int64,
    ) -> Push:
        time = wp.float64(step) * model.time_step
        for o in range(model.obstacles.shape.shape[0]):
            wall = pose_at(model.obstacles, o, time)
            away = wp.length(pose.position - wall.position)
            if away < model.body.bound[a] + grid.reach + model.obstacles.bound[o]:
                motion = wp.vec3(0.0)
                if wp.static(f.moving_obstacles):
                    motion = moving_pose(model.obstacles, o, time + model.time_step).position - wall.position
                for i in range(model.contact.start[a], model.contact.start[a + 1]):
                    s = model.contact.sphere[i]
                    arm = wp.quat_rotate(pose.rotation, wp.vec3(s[0], s[1], s[2]))
                    local = wp.quat_rotate_inv(wall.rotation, pose.position + arm - wall.position)
                    hit = distance_to(model.obstacles, o, local, s[3] + grid.reach)
                    overlap = s[3] - hit[3]
                    if overlap > -grid.reach:
                        if overlap > OVERLAP_LIMIT * s[3]:
                            raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
                        normal = wp.quat_rotate(wall.rotation, wp.vec3(hit[0], hit[1], hit[2]))
                        c = new_contact(
                            model, world, a, NO_CONTACT, pose, wall, arm, wp.vec3(0.0), normal, s[3], overlap
                        )
                        c.drift = wp.dot(motion, normal)
                        total = add_contact(total, c, free_opening(grid, world, c))
        return total

    return walls


def make_touch(f: Features) -> wp.Kernel:
    """Kernel over (world, body): displacement by contact, and the contact readout."""
    neighbours = neighbour_term(f) if f.pairs else None
    walls = wall_term(f) if f.obstacles else None
    body_pose = body_pose_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def touch(model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, table: wp.uint64):
        world, a = wp.tid()
        step = grid.clock[0]
        pose = body_pose(state, world, a)
        total = Push(wp.vec3(0.0), wp.vec3(0.0), wp.vec3(0.0), float(0.0))
        if wp.static(f.pairs):
            total = neighbours(model, state, readout, grid, table, world, a, pose, total, step)
        if wp.static(bool(f.obstacles)):
            total = walls(model, readout, grid, world, a, pose, total, step)
        grid.push_linear[world, a] = total.linear
        if wp.static(f.rigid):
            grid.push_angular[world, a] = total.angular
        readout.contact_force[world, a] = total.force
        readout.contact_load[world, a] = total.load

    return touch


def make_commit(f: Features) -> wp.Kernel:
    """Kernel over (world, body): apply the displacements unless the body has a fault, place its spheres."""
    note_escapes = escape_term(f) if f.escapes else None
    body_pose = body_pose_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def commit(model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData):
        world, b = wp.tid()
        step = grid.clock[0]
        pose = body_pose(state, world, b)
        linear = grid.linear[world, b]
        angular = wp.vec3(0.0)
        if wp.static(f.contacts):
            linear += grid.push_linear[world, b]
        if wp.static(f.rigid):
            angular = grid.angular[world, b]
            if wp.static(f.contacts):
                angular += grid.push_angular[world, b]
        if not finite(pose.position + linear + angular):
            raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
        if readout.fault[world, b] == 0:
            pose.position = pose.position + linear
            state.position[world, b] = pose.position
            if wp.static(f.rigid):
                pose.rotation = rotate_by(pose.rotation, angular)
                state.orientation[world, b] = pose.rotation
        if wp.static(f.escapes):
            time = wp.float64(step + wp.int64(1)) * model.time_step
            note_escapes(model, control, state, readout, world, b, pose, step + wp.int64(1), time)
        if wp.static(f.pairs):
            spheres = model.contact.sphere.shape[0]
            for i in range(model.contact.start[b], model.contact.start[b + 1]):
                s = model.contact.sphere[i]
                grid.centre[world * spheres + i] = pose.position + wp.quat_rotate(
                    pose.rotation, wp.vec3(s[0], s[1], s[2])
                )

    return commit


def make_move_traps(f: Features) -> wp.Kernel:
    """Kernel over (world, trap): move the foci towards their commands within their speed limits."""
    commanded = commanded_animated if f.moving_traps else commanded_still

    @wp.kernel(module="unique", enable_backward=False)
    def move_traps(model: ModelData, control: ControlData, state: StateData, grid: GridData):
        world, trap = wp.tid()
        time = wp.float64(grid.clock[0]) * model.time_step
        wanted = commanded(model.traps, control, world, trap, time)
        state.trap_position[world, trap] = limited_focus(
            model.traps,
            world,
            trap,
            state.trap_position[world, trap],
            wp.vec3(wanted[0], wanted[1], wanted[2]),
            wp.float32(model.time_step),
        )

    return move_traps


@wp.kernel(enable_backward=False)
def tick(grid: GridData):
    """Count one step."""
    grid.clock[0] = grid.clock[0] + wp.int64(1)


@wp.kernel(enable_backward=False)
def place_spheres(model: ModelData, state: StateData, grid: GridData, rigid: int):
    """Centres of all colliding spheres from the present poses: before the first build, and after a restore."""
    world, b = wp.tid()
    rotation = wp.quat_identity()
    if rigid != 0:
        rotation = state.orientation[world, b]
    spheres = model.contact.sphere.shape[0]
    for i in range(model.contact.start[b], model.contact.start[b + 1]):
        s = model.contact.sphere[i]
        arm = wp.quat_rotate(rotation, wp.vec3(s[0], s[1], s[2]))
        grid.centre[world * spheres + i] = state.position[world, b] + arm
        grid.group[world * spheres + i] = world
