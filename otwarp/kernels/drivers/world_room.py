"""Room that a thread of the `world` driver has for its world: arrays, handed on together in structs.

Local arrays live as long as the function that makes them, so the kernel makes them, and the structs with them. A GPU
reserves them for as many threads as it can hold, used or not; what grows with the contacts that a world can have is
therefore a row of arrays of all worlds, `WorldScratch`.
"""

import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.contact_list import ContactList, has_ridges
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.step_constants import BodyConstants
from otwarp.kernels.core.types import ControlData, ModelData, StateData, vec6
from otwarp.kernels.integrate.body import body_dynamics


@wp.struct
class BodyRoom:
    """(bodies) poses, and what a step moves the bodies."""

    position: wp.array(dtype=wp.vec3)
    rotation: wp.array(dtype=wp.quat)
    linear: wp.array(dtype=wp.vec3)  # whole move as far as it is known [µm]
    angular: wp.array(dtype=wp.vec3)  # [rad]
    free: wp.array(dtype=vec6)  # move without contacts, as predicted
    drift: wp.array(dtype=vec6)  # its drift at the start of the step; then what contacts take from it
    constants: wp.array(dtype=BodyConstants)  # as read once, where they are kept


@wp.struct
class SolveRoom:
    """What `solve_contacts` takes."""

    matrix: wp.array(dtype=float)  # (contacts²)
    gap: wp.array(dtype=float)  # (contacts), as all that follow
    right: wp.array(dtype=float)
    pivot: wp.array(dtype=float)
    order: wp.array(dtype=int)
    on: wp.array(dtype=int)


@wp.struct
class ContactRoom:
    """Contacts of a world, and what it takes to solve them, one way or the other."""

    listed: ContactList
    solve: SolveRoom
    moved: wp.array(dtype=wp.vec3)  # as in `SpaceRoom`


@wp.struct
class Found:
    """What was found to touch in a step."""

    count: int
    """Contacts."""
    partners: int
    """As in `point_solve`, where contacts are solved so."""


@wp.struct
class WorldScratch:
    """(worlds, contacts) of `ContactList` and `SolveRoom`, one row a world; those without use have no length."""

    whole: wp.array2d(dtype=Contact)
    pair: wp.array2d(dtype=wp.vec2i)
    face: wp.array2d(dtype=wp.vec4)
    law: wp.array2d(dtype=wp.vec4)
    path: wp.array2d(dtype=wp.vec2)
    depth: wp.array2d(dtype=float)
    arm_a: wp.array2d(dtype=wp.vec4)
    arm_b: wp.array2d(dtype=wp.vec4)
    ridge: wp.array2d(dtype=wp.vec3)
    drift: wp.array2d(dtype=wp.vec3)
    matrix: wp.array2d(dtype=float)
    gap: wp.array2d(dtype=float)
    right: wp.array2d(dtype=float)
    pivot: wp.array2d(dtype=float)
    order: wp.array2d(dtype=int)
    on: wp.array2d(dtype=int)
    # of the `phased` form: what its kernels hand on
    count: wp.array(dtype=int)  # (worlds) as in `Found`
    partners: wp.array(dtype=int)
    rotation: wp.array2d(dtype=wp.quat)  # (worlds, bodies) as in `BodyRoom`, where no body rotates
    linear: wp.array2d(dtype=wp.vec3)
    angular: wp.array2d(dtype=wp.vec3)
    free: wp.array2d(dtype=vec6)
    body_drift: wp.array2d(dtype=vec6)
    moved: wp.array2d(dtype=wp.vec3)  # (worlds, nodes) as in `SpaceRoom`


@wp.struct
class CarryRoom:
    """What bodies that carry each other along need besides; without arrays where they do not."""

    pair: wp.array(dtype=wp.mat33)  # (blocks) tensors at the start of the step
    root: wp.array(dtype=wp.mat33)  # (blocks) factor of the noise
    force: wp.array(dtype=wp.vec3)  # (bodies)
    there: wp.array(dtype=wp.vec3)  # (bodies) positions at the end of the step, where an integrator looks again
    turned: wp.array(dtype=wp.quat)  # rotations there
    later: wp.array(dtype=vec6)  # drift there


@wp.func
def list_of(whole: wp.array(dtype=Contact)) -> ContactList:
    """A list of contacts, each kept as one whole record with the units of `Contact`."""
    no = ContactList()
    return ContactList(whole, no.pair, no.face, no.law, no.path, no.depth, no.arm_a, no.arm_b, no.ridge, no.drift)


def list_in_term(f: Features) -> wp.Function:
    """`(scratch, row) -> ContactList`: a world's list in the scratch of all."""

    @wp.func
    def list_in(scratch: WorldScratch, row: int) -> ContactList:
        """The contacts that row `row` has room for, as views into arrays of all worlds: nothing is copied."""
        listed = ContactList()
        if wp.static(f.body_space):
            listed.pair = scratch.pair[row]
            listed.face = scratch.face[row]
            listed.law = scratch.law[row]
            listed.path = scratch.path[row]
            listed.depth = scratch.depth[row]
            listed.arm_a = scratch.arm_a[row]
            listed.arm_b = scratch.arm_b[row]
            if wp.static(has_ridges(f)):
                listed.ridge = scratch.ridge[row]
            if wp.static(f.moving_obstacles):
                listed.drift = scratch.drift[row]
        else:
            listed.whole = scratch.whole[row]
        return listed

    return list_in


def bodies_in_term(f: Features) -> wp.Function:
    """`(state, scratch, world, row) -> BodyRoom`: the bodies of a world in the state and in the scratch of all."""

    @wp.func
    def bodies_in(state: StateData, scratch: WorldScratch, world: int, row: int) -> BodyRoom:
        """Views: what is written to the poses is in the state at once."""
        body = BodyRoom()
        body.position = state.position[world]
        if wp.static(f.rigid):
            body.rotation = state.orientation[world]
        else:
            body.rotation = scratch.rotation[row]
        body.linear = scratch.linear[row]
        body.angular = scratch.angular[row]
        body.free = scratch.free[row]
        body.drift = scratch.body_drift[row]
        return body

    return bodies_in


@wp.func
def solve_room_in(scratch: WorldScratch, row: int) -> SolveRoom:
    """Views of a row of the scratch of all worlds."""
    return SolveRoom(
        scratch.matrix[row], scratch.gap[row], scratch.right[row], scratch.pivot[row], scratch.order[row],
        scratch.on[row],
    )  # fmt: skip


def constants_term(f: Features) -> wp.Function:
    """`(model, control, world, b, body: BodyRoom)` → the constants of body b, as `body_dynamics` takes them."""
    constants_of, _ = body_dynamics(f)

    @wp.func
    def kept_of_any(model: ModelData, control: ControlData, world: int, b: int, body: BodyRoom):
        """Those that `keep_constants_term` has read [units of `BodyConstants`]."""
        return body.constants[b]

    @wp.func
    def kept_of_rigid(model: ModelData, control: ControlData, world: int, b: int, body: BodyRoom):
        """Those that `keep_constants_term` has read [units of `RigidConstants`]."""
        return body.constants[b].rigid

    @wp.func
    def read(model: ModelData, control: ControlData, world: int, b: int, body: BodyRoom):
        """Read anew: registers of a GPU are worth more."""
        return constants_of(model, control, world, b)

    return (kept_of_any if f.spheres else kept_of_rigid) if f.cached else read


def keep_constants_term(f: Features) -> wp.Function:
    """`(model, control, world, body: BodyRoom)`: read the constants that `constants_term` finds."""
    constants_of, _ = body_dynamics(f)

    @wp.func
    def keep_constants(model: ModelData, control: ControlData, world: int, body: BodyRoom):
        """Constants of all bodies, of which a scene of rigid bodies alone has the rigid half."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            if wp.static(f.spheres):
                body.constants[b] = constants_of(model, control, world, b)
            else:
                body.constants[b].rigid = constants_of(model, control, world, b)

    return keep_constants


def load_bodies_term(f: Features) -> wp.Function:
    """`(state, world, body: BodyRoom)`: poses of a world's bodies from the state."""

    @wp.func
    def load_bodies(state: StateData, world: int, body: BodyRoom):
        """Read positions [µm] and orientations; lone spheres have the identity."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            body.position[b] = state.position[world, b]
            body.rotation[b] = wp.quat_identity()
            if wp.static(f.rigid):
                body.rotation[b] = state.orientation[world, b]

    return load_bodies


def store_bodies_term(f: Features) -> wp.Function:
    """`(state, world, body: BodyRoom)`: the inverse of `load_bodies_term`."""

    @wp.func
    def store_bodies(state: StateData, world: int, body: BodyRoom):
        """Write positions [µm], and orientations where bodies rotate."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            state.position[world, b] = body.position[b]
            if wp.static(f.rigid):
                state.orientation[world, b] = body.rotation[b]

    return store_bodies
