"""Contacts of the body driver: every body lists its own, and sweeps find their forces together.

The sweeps are accelerated proximal gradient steps (Beck, Teboulle 2009, doi:10.1137/080716542; for contact: Mazhar,
Heyn, Negrut, Tasora 2015, doi:10.1145/2735627) on the energy ½ λᵀ(1/k + G) λ − λᵀ(F/k − s₀) over λ ≥ floor, whose
minimum are the forces that `solve` finds directly: G is the opening of gap i per unit force in contact j, s₀ the
opening without contact forces. A sweep divides by 1/k + crowding·give, by Gershgorin's theorem at least the row sum of
1/k + G: no stiffness makes it diverge. Momentum restarts contact by contact where it points uphill (O'Donoghue, Candès
2015, doi:10.1007/s10208-013-9150-3). A body without contacts costs one comparison, a settled world one per sweep.
"""

import warp as wp

from otwarp.kernels.contact import SETTLED, UNSETTLED, Contact, along
from otwarp.kernels.detect import touch_term, touch_wall_term
from otwarp.kernels.faults import Fault, finite, raise_fault
from otwarp.kernels.features import MAX_BODY_CONTACTS, Features
from otwarp.kernels.grid_data import GridData, PushData, body_pose_term
from otwarp.kernels.obstacles import distance_term, moving_pose, still_pose
from otwarp.kernels.types import ModelData, Move, Pose, ReadoutData, StateData

RELAXATIONS = 32
"""Most sweeps over the contacts in one step (even, because they write to two buffers in turn)."""

CHUNKS = 64
"""Parts into which the bodies of a world are divided for sums over all contacts."""


def opening_term(f: Features) -> wp.Function:
    """`(grid, push, world, c, scale) -> opening` of a contact's gap by all displacements of this step [µm]."""

    @wp.func
    def move_of(grid: GridData, push: PushData, world: int, b: int, scale: float) -> Move:
        """Free displacement and `scale` times the push of one body."""
        move = Move(grid.linear[world, b] + scale * push.linear[world, b], wp.vec3(0.0))
        if wp.static(f.rigid):
            move.angular = grid.angular[world, b] + scale * push.angular[world, b]
        return move

    @wp.func
    def opening(grid: GridData, push: PushData, world: int, c: Contact, scale: float) -> float:
        """Of both partners along the normal, less the obstacle's own motion."""
        total = along(move_of(grid, push, world, c.a, scale), c.arm_a, c.normal) - c.drift
        if c.b >= 0:
            total -= along(move_of(grid, push, world, c.b, scale), c.arm_b, c.normal)
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


@wp.func
def overlap_of(model: ModelData, grid: GridData, world: int, i: int, j: int) -> float:
    """Overlap of two spheres of a world [µm]."""
    spheres = model.contact.sphere.shape[0]
    way = grid.centre[world * spheres + i] - grid.centre[world * spheres + j]
    return model.contact.sphere[i][3] + model.contact.sphere[j][3] - wp.length(way)


def neighbour_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, table, world, a, pose, count, step) -> count` of contacts with other bodies.

    The grid promises no order, and the sum of forces depends on it in the last bit: neighbours are sorted first.
    """
    touch = touch_term(f)
    body_pose = body_pose_term(f)

    @wp.func
    def contact_of(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, a: int, pose: Pose,
        i: int, j: int, step: wp.int64,
    ) -> Contact:  # fmt: skip
        """The contact of sphere i of body a with sphere j."""
        spheres = model.contact.sphere.shape[0]
        b = model.contact.body[j]
        pose_b = body_pose(state, world, b)
        arm_a = grid.centre[world * spheres + i] - pose.position
        arm_b = grid.centre[world * spheres + j] - pose_b.position
        ri = model.contact.sphere[i][3]
        rj = model.contact.sphere[j][3]
        return touch(model, readout, world, a, b, pose, pose_b, arm_a, arm_b, ri, rj, step)

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
                c = contact_of(model, state, readout, grid, world, a, pose, i, near[k], step)
                count = list_contact(readout, grid, world, world * model.bodies + a, count, c, step)
        return count

    return neighbours


def wall_term(f: Features) -> wp.Function:
    """`(model, readout, grid, world, a, pose, count, step) -> count` of contacts with obstacles."""
    touch_wall = touch_wall_term(f)
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
                later = wall
                if wp.static(f.moving_obstacles):
                    later = pose_at(model.obstacles, o, time + model.time_step)
                for i in range(model.contact.start[a], model.contact.start[a + 1]):
                    s = model.contact.sphere[i]
                    arm = wp.quat_rotate(pose.rotation, wp.vec3(s[0], s[1], s[2]))
                    local = wp.quat_rotate_inv(wall.rotation, pose.position + arm - wall.position)
                    hit = distance_to(model.obstacles, o, local, s[3] + grid.reach)
                    if hit[3] < s[3] + grid.reach:
                        c = touch_wall(model, readout, world, a, pose, wall, later, arm, s[3], local, hit, step)
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
        if own > 0.0:
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
        row = world * model.bodies + a
        pose = body_pose(state, world, a)
        count = int(0)
        if wp.static(f.pairs):
            count = neighbours(model, state, readout, grid, table, world, a, pose, count, step)
        if wp.static(bool(f.obstacles)):
            count = walls(model, readout, grid, world, a, pose, count, step)
        grid.count[world, a] = count
        grid.crowding[world, a] = crowding_of(grid, row, count)
        linear = wp.vec3(0.0)
        angular = wp.vec3(0.0)
        for i in range(count):
            c = grid.contact[row, i]
            grid.ahead[row, i] = c.load
            linear += c.load * c.response_a.linear
            angular += c.load * c.response_a.angular
        push.linear[world, a] = linear
        if wp.static(f.rigid):
            push.angular[world, a] = angular
        if a == 0:
            for sweep in range(grid.moving.shape[1]):
                grid.moving[world, sweep] = 0

    return find


def make_weigh(f: Features) -> wp.Kernel:
    """Kernel over (world, chunk of bodies): the sums from which `guess_scale` follows, in an order that is fixed.

    Along λ = α·F the energy of the sweeps is least at α = ΣF(F/k − s₀) / ΣF(F/k + GF): 1 for what is squeezed or at
    rest, little where an impact would throw stiff bodies far. A contact of two bodies is in both lists, half in each.
    """
    opening = opening_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def weigh(model: ModelData, grid: GridData, push: PushData):
        """One chunk's share."""
        world, chunk = wp.tid()
        chunks = grid.share.shape[1]
        total = wp.vec2(0.0)
        for a in range(model.bodies * chunk // chunks, model.bodies * (chunk + 1) // chunks):
            row = world * model.bodies + a
            for i in range(grid.count[world, a]):
                c = grid.contact[row, i]
                if c.stiffness > 0.0:
                    free = opening(grid, push, world, c, 0.0)
                    pushed = opening(grid, push, world, c, 1.0) - free
                    gap = c.force / c.stiffness
                    total += wp.where(c.b >= 0, 0.5, 1.0) * c.force * wp.vec2(gap - free, gap + pushed)
        grid.share[world, chunk] = total

    return weigh


@wp.func
def guess_scale(grid: GridData, world: int) -> float:
    """α of the first guess λ = α·F."""
    total = wp.vec2(0.0)
    for chunk in range(grid.share.shape[1]):
        total += grid.share[world, chunk]
    scale = float(0.0)
    if total[0] > 0.0:
        scale = wp.min(total[0] / wp.max(total[1], 1.0e-30), 1.0)
    return scale


@wp.func
def gap_error(c: Contact, start: float, wanted: float) -> float:
    """How far the gap was from what the force law asks for at the force `start` [µm]."""
    error = float(0.0)
    if c.stiffness > 0.0:
        error = wp.abs(wp.max(wanted, c.floor) - start) / c.stiffness
    return error


def relax_body_term(f: Features) -> wp.Function:
    """`(model, readout, grid, before, after, sweep, world, a)`: one sweep over the contacts of one body.

    The momentum of each contact is that of its own condition 1 + crowding·k·give.
    """
    opening = opening_term(f)

    @wp.func
    def relax_body(
        model: ModelData, readout: ReadoutData, grid: GridData, before: PushData, after: PushData,
        sweep: int, world: int, a: int,
    ):  # fmt: skip
        """One body's contact forces, and the push from which the next sweep starts."""
        row = world * model.bodies + a
        count = grid.count[world, a]
        last = sweep == grid.moving.shape[1] - 1
        scale = float(1.0)
        if sweep == 0 and count > 0:
            scale = guess_scale(grid, world)
        linear = wp.vec3(0.0)
        angular = wp.vec3(0.0)
        force = wp.vec3(0.0)
        total = float(0.0)
        for i in range(count):
            c = grid.contact[row, i]
            crowding = grid.crowding[world, a]
            if c.b >= 0:
                crowding = wp.max(crowding, grid.crowding[world, c.b])
            start = scale * grid.ahead[row, i]
            wanted = c.force - c.stiffness * opening(grid, before, world, c, scale)
            limit = 1.0 + crowding * c.stiffness * c.give
            load = wp.max(start + (wanted - start) / limit, c.floor)
            if wp.abs(load - start) * c.give > wp.static(SETTLED):
                grid.moving[world, sweep] = 1
            ahead = load
            if last:
                # a free move without bound is the fault that `commit` reports
                if gap_error(c, start, wanted) > UNSETTLED * c.radius and finite(grid.linear[world, a]):
                    raise_fault(readout, world, a, wp.static(int(Fault.UNSETTLED)), grid.clock[0])
            else:
                root = wp.sqrt(limit)
                momentum = wp.min((root - 1.0) / (root + 1.0), float(sweep) / float(sweep + 3))
                if (start - load) * (load - c.load) <= 0.0:  # else it went too far: restart
                    ahead += momentum * (load - c.load)
            grid.contact[row, i].load = load
            grid.ahead[row, i] = ahead
            linear += ahead * c.response_a.linear
            angular += ahead * c.response_a.angular
            force += load * c.normal
            total += wp.abs(load)
        after.linear[world, a] = linear
        if wp.static(f.rigid):
            after.angular[world, a] = angular
        readout.contact_force[world, a] = force
        readout.contact_load[world, a] = total

    return relax_body


def make_relax(f: Features) -> wp.Kernel:
    """Kernel over (world, share of the bodies): one sweep, and the contact readout.

    Both partners compute the same λ from the same numbers, so the third law holds to rounding. A lone contact is
    solved by the first sweep.
    """
    relax_body = relax_body_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def relax(
        model: ModelData, readout: ReadoutData, grid: GridData, before: PushData, after: PushData,
        sweep: int, threads: int,
    ):  # fmt: skip
        """One of the `threads` shares of a world's bodies: one body each on a GPU, all in one thread on a CPU."""
        world, share = wp.tid()
        if sweep > 1:
            # two sweeps at rest, so that both push buffers hold the solution
            if grid.moving[world, sweep - 1] == 0 and grid.moving[world, sweep - 2] == 0:
                return
        for a in range(model.bodies * share // threads, model.bodies * (share + 1) // threads):
            relax_body(model, readout, grid, before, after, sweep, world, a)

    return relax
