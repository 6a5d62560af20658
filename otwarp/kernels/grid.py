"""The body driver: one thread per body and step, neighbours from a hash grid, for scenes with many touching bodies.

A step is: `advance` (free displacements), a build of the grid, `find` (each body lists its contacts), a few sweeps of
`relax` (contact forces from the displacements of both partners) and `commit` (apply, and place the spheres for the
next build). All steps and worlds use the same launches, so a step is captured in a graph; the step counter lives in
device memory.
"""

import warp as wp

from otwarp.kernels.body import free_move_term, move_trap_term
from otwarp.kernels.contact import NO_CONTACT, Contact, along
from otwarp.kernels.detect import new_contact_term
from otwarp.kernels.escapes import escape_term
from otwarp.kernels.faults import OVERLAP_LIMIT, Fault, finite, raise_fault
from otwarp.kernels.features import MAX_BODY_CONTACTS, Features
from otwarp.kernels.obstacles import distance_term, moving_pose, still_pose
from otwarp.kernels.rotation import rotate_by
from otwarp.kernels.types import ControlData, ModelData, Move, Pose, ReadoutData, StateData

RELAXATIONS = 8
"""Sweeps over the contacts in one step (even, because they write to two buffers in turn)."""


@wp.struct
class GridData:
    """Scratch of the body driver."""

    clock: wp.array(dtype=wp.int64)  # (1) step counter
    linear: wp.array2d(dtype=wp.vec3)  # (W, B) free displacement [µm]
    angular: wp.array2d(dtype=wp.vec3)  # (W, B) free rotation [rad]
    contact: wp.array2d(dtype=Contact)  # (W·B, MAX_BODY_CONTACTS) contacts of each body, seen from it
    count: wp.array2d(dtype=wp.int32)  # (W, B) how many
    crowding: wp.array2d(dtype=wp.float32)  # (W, B) how much they hinder each other, 1: a lone contact
    centre: wp.array(dtype=wp.vec3)  # (W·C) centres of the colliding spheres [µm]
    group: wp.array(dtype=wp.int32)  # (W·C) world of each
    largest: float  # radius of the largest colliding sphere [µm]
    reach: float  # longest range of adhesion [µm]


@wp.struct
class PushData:
    """What the contacts move in a step."""

    linear: wp.array2d(dtype=wp.vec3)  # (W, B) [µm]
    angular: wp.array2d(dtype=wp.vec3)  # (W, B), (W, 0) without rotation [rad]


def make_advance(f: Features) -> wp.Kernel:
    """Kernel over (world, body): free displacement of this step."""
    free_move = free_move_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def advance(model: ModelData, control: ControlData, state: StateData, grid: GridData):
        """One body's free move."""
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
        """Position, and orientation where bodies rotate."""
        pose = Pose(state.position[world, b], wp.quat_identity())
        if wp.static(f.rigid):
            pose.rotation = state.orientation[world, b]
        return pose

    return body_pose


def opening_term(f: Features) -> wp.Function:
    """`(grid, push, world, c) -> opening` of a contact's gap by all displacements of this step [µm]."""

    @wp.func
    def move_of(grid: GridData, push: PushData, world: int, b: int) -> Move:
        """Free displacement and push of one body."""
        move = Move(grid.linear[world, b] + push.linear[world, b], wp.vec3(0.0))
        if wp.static(f.rigid):
            move.angular = grid.angular[world, b] + push.angular[world, b]
        return move

    @wp.func
    def opening(grid: GridData, push: PushData, world: int, c: Contact) -> float:
        """Of both partners along the normal, less the obstacle's own motion."""
        total = along(move_of(grid, push, world, c.a), c.arm_a, c.normal) - c.drift
        if c.b >= 0:
            total -= along(move_of(grid, push, world, c.b), c.arm_b, c.normal)
        return total

    return opening


@wp.func
def list_contact(
    readout: ReadoutData, grid: GridData, world: int, row: int, count: int, c: Contact, step: wp.int64
) -> int:
    """Append a contact that carries a force to its body's list; its first guess is the force at the start."""
    if c.force == 0.0 and c.stiffness == 0.0:
        return count
    if count == grid.contact.shape[1]:
        raise_fault(readout, world, c.a, wp.static(int(Fault.OVERFLOW)), step)
        return count
    c.load = c.force
    grid.contact[row, count] = c
    return count + 1


@wp.func
def insert_sorted(near: wp.array(dtype=wp.int32), found: int, value: int):
    """Insert `value` into the first `found` entries of `near`, which ascend; there is room for one more."""
    k = found
    while k > 0 and near[wp.max(k - 1, 0)] > value:
        near[k] = near[k - 1]
        k -= 1
    near[k] = value


def neighbour_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, table, world, a, pose, count, step) -> count` of contacts with other bodies.

    The grid promises no order, and the sum of forces depends on it in the last bit: neighbours are sorted first.
    """
    new_contact = new_contact_term(f)
    body_pose = body_pose_term(f)

    @wp.func
    def overlap_of(model: ModelData, grid: GridData, world: int, i: int, j: int) -> float:
        """Overlap of two spheres of a world [µm]."""
        spheres = model.contact.sphere.shape[0]
        way = grid.centre[world * spheres + i] - grid.centre[world * spheres + j]
        return model.contact.sphere[i][3] + model.contact.sphere[j][3] - wp.length(way)

    @wp.func
    def touch(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, a: int, pose: Pose,
        i: int, j: int, step: wp.int64,
    ) -> Contact:  # fmt: skip
        """The contact of sphere i of body a with sphere j."""
        spheres = model.contact.sphere.shape[0]
        b = model.contact.body[j]
        here = grid.centre[world * spheres + i]
        there = grid.centre[world * spheres + j]
        ri = model.contact.sphere[i][3]
        rj = model.contact.sphere[j][3]
        overlap = overlap_of(model, grid, world, i, j)
        if overlap > OVERLAP_LIMIT * wp.min(ri, rj):
            raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
        pose_b = body_pose(state, world, b)
        arm_a = here - pose.position
        arm_b = there - pose_b.position
        radius = ri * rj / (ri + rj)
        normal = wp.normalize(here - there)
        return new_contact(model, world, a, b, pose, pose_b, arm_a, arm_b, normal, radius, overlap)

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
        count: int,
        step: wp.int64,
    ) -> int:
        """The body's spheres against those that the hash grid finds near them."""
        spheres = model.contact.sphere.shape[0]
        near = wp.zeros(shape=(wp.static(MAX_BODY_CONTACTS),), dtype=wp.int32)
        for i in range(model.contact.start[a], model.contact.start[a + 1]):
            here = grid.centre[world * spheres + i]
            found = int(0)
            for other in wp.hash_grid_query(table, here, model.contact.sphere[i][3] + grid.largest + grid.reach, world):
                j = other - world * spheres
                if model.contact.body[j] != a and overlap_of(model, grid, world, i, j) > -grid.reach:
                    if found < wp.static(MAX_BODY_CONTACTS):
                        insert_sorted(near, found, j)
                        found += 1
                    else:
                        raise_fault(readout, world, a, wp.static(int(Fault.OVERFLOW)), step)
            for k in range(found):
                c = touch(model, state, readout, grid, world, a, pose, i, near[k], step)
                count = list_contact(readout, grid, world, world * model.bodies + a, count, c, step)
        return count

    return neighbours


def wall_term(f: Features) -> wp.Function:
    """`(model, readout, grid, world, a, pose, count, step) -> count` of contacts with obstacles."""
    new_contact = new_contact_term(f)
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
        count: int,
        step: wp.int64,
    ) -> int:
        """The body's spheres against the obstacles near it."""
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
                        count = list_contact(readout, grid, world, world * model.bodies + a, count, c, step)
        return count

    return walls


@wp.func
def crowding_of(grid: GridData, row: int, count: int) -> float:
    """Largest Σ_j |response of contact i's gap to force j| / |its response to its own|, this body's share alone.

    By Gershgorin's theorem a bound on how much more the body gives way to all its contacts at once than to one.
    """
    crowding = float(1.0)
    for i in range(count):
        c = grid.contact[row, i]
        own = along(c.response_a, c.arm_a, c.normal)
        total = float(0.0)
        for j in range(count):
            total += wp.abs(along(grid.contact[row, j].response_a, c.arm_a, c.normal))
        crowding = wp.max(crowding, total / own)
    return crowding


def make_find(f: Features) -> wp.Kernel:
    """Kernel over (world, body): list the contacts of each body, and what their forces at the start would move."""
    neighbours = neighbour_term(f) if f.pairs else None
    walls = wall_term(f) if f.obstacles else None
    body_pose = body_pose_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def find(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, table: wp.uint64
    ):
        """One body's contacts and first push."""
        world, a = wp.tid()
        step = grid.clock[0]
        pose = body_pose(state, world, a)
        count = int(0)
        if wp.static(f.pairs):
            count = neighbours(model, state, readout, grid, table, world, a, pose, count, step)
        if wp.static(bool(f.obstacles)):
            count = walls(model, readout, grid, world, a, pose, count, step)
        grid.count[world, a] = count
        grid.crowding[world, a] = crowding_of(grid, world * model.bodies + a, count)
        linear = wp.vec3(0.0)
        angular = wp.vec3(0.0)
        for i in range(count):
            c = grid.contact[world * model.bodies + a, i]
            linear += c.load * c.response_a.linear
            angular += c.load * c.response_a.angular
        push.linear[world, a] = linear
        if wp.static(f.rigid):
            push.angular[world, a] = angular

    return find


def make_relax(f: Features) -> wp.Kernel:
    """Kernel over (world, body): one Jacobi sweep of backward Euler, λ = max(floor, F − k·s), and the contact readout.

    Every contact is damped by the crowding of its busier partner: the sweep then never overshoots, whatever the
    stiffness, and a lone contact is solved at once. Both partners compute the same λ from the same numbers, so the
    third law holds to rounding. Starting from the forces F leaves alone what moves nothing, such as the forces that
    squeeze a body from two sides.
    """
    opening = opening_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def relax(model: ModelData, readout: ReadoutData, grid: GridData, before: PushData, after: PushData):
        """One body's contact forces and push after one more sweep."""
        world, a = wp.tid()
        row = world * model.bodies + a
        count = grid.count[world, a]
        linear = wp.vec3(0.0)
        angular = wp.vec3(0.0)
        force = wp.vec3(0.0)
        total = float(0.0)
        for i in range(count):
            c = grid.contact[row, i]
            crowding = grid.crowding[world, a]
            if c.b >= 0:
                crowding = wp.max(crowding, grid.crowding[world, c.b])
            wanted = c.force - c.stiffness * opening(grid, before, world, c)
            load = c.load + (wanted - c.load) / (1.0 + crowding * c.stiffness * c.give)
            load = wp.max(load, c.floor)
            grid.contact[row, i].load = load
            linear += load * c.response_a.linear
            angular += load * c.response_a.angular
            force += load * c.normal
            total += wp.abs(load)
        after.linear[world, a] = linear
        if wp.static(f.rigid):
            after.angular[world, a] = angular
        readout.contact_force[world, a] = force
        readout.contact_load[world, a] = total

    return relax


def make_commit(f: Features) -> wp.Kernel:
    """Kernel over (world, body): apply the displacements unless the body has a fault, place its spheres."""
    note_escapes = escape_term(f) if f.escapes else None
    body_pose = body_pose_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def commit(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        grid: GridData,
        push: PushData,
    ):
        """One body's new pose, and where that puts its spheres."""
        world, b = wp.tid()
        step = grid.clock[0]
        pose = body_pose(state, world, b)
        linear = grid.linear[world, b]
        angular = wp.vec3(0.0)
        if wp.static(f.contacts):
            linear += push.linear[world, b]
        if wp.static(f.rigid):
            angular = grid.angular[world, b]
            if wp.static(f.contacts):
                angular += push.angular[world, b]
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
    move_trap = move_trap_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def move_traps(model: ModelData, control: ControlData, state: StateData, grid: GridData):
        """One focus."""
        world, trap = wp.tid()
        move_trap(model, control, state, world, trap, wp.float64(grid.clock[0]) * model.time_step)

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
