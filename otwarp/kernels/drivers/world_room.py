"""Room that a thread of the `world` driver has for its world: local arrays, handed on together in structs.

Local arrays live as long as the function that makes them, so the kernel makes them, and the structs with them.
"""

import warp as wp

from otwarp.kernels.contact.body_solve import SpaceRoom
from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import StateData, vec6


@wp.struct
class BodyRoom:
    """(bodies) poses, and what a step moves the bodies."""

    position: wp.array(dtype=wp.vec3)
    rotation: wp.array(dtype=wp.quat)
    linear: wp.array(dtype=wp.vec3)  # whole move as far as it is known [µm]
    angular: wp.array(dtype=wp.vec3)  # [rad]
    free: wp.array(dtype=vec6)  # move without contacts, as predicted
    drift: wp.array(dtype=vec6)  # its drift at the start of the step; then what contacts take from it


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
    """(contacts) of a world, and what it takes to solve them, one way or the other."""

    contacts: wp.array(dtype=Contact)
    solve: SolveRoom
    space: SpaceRoom


@wp.struct
class CarryRoom:
    """What bodies that carry each other along need besides; without arrays where they do not."""

    pair: wp.array(dtype=wp.mat33)  # (blocks) tensors at the start of the step
    root: wp.array(dtype=wp.mat33)  # (blocks) factor of the noise
    force: wp.array(dtype=wp.vec3)  # (bodies)
    there: wp.array(dtype=wp.vec3)  # (bodies) positions at the end of the step, where an integrator looks again
    turned: wp.array(dtype=wp.quat)  # rotations there
    later: wp.array(dtype=vec6)  # drift there


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
