"""Scratch of the body driver, and the pose of a body as its kernels read it."""

import warp as wp

from otwarp.kernels.contact import Contact
from otwarp.kernels.features import Features
from otwarp.kernels.types import Pose, StateData


@wp.struct
class GridData:
    """Scratch of the body driver."""

    clock: wp.array(dtype=wp.int64)  # (1) step counter
    linear: wp.array2d(dtype=wp.vec3)  # (W, B) free displacement [µm]
    angular: wp.array2d(dtype=wp.vec3)  # (W, B) free rotation [rad]
    contact: wp.array2d(dtype=Contact)  # (W·B, MAX_BODY_CONTACTS) contacts of each body, seen from it
    count: wp.array2d(dtype=wp.int32)  # (W, B) how many
    crowding: wp.array2d(dtype=wp.float32)  # (W, B) how much they hinder each other, 1: a lone contact
    ahead: wp.array2d(dtype=wp.float32)  # (W·B, MAX_BODY_CONTACTS) force from which the next sweep starts [pN]
    moving: wp.array2d(dtype=wp.int32)  # (W, RELAXATIONS) 1: some contact of the world was not settled in this sweep
    share: wp.array2d(dtype=wp.vec2)  # (W, CHUNKS) parts of the sums that scale the first guess [pN·µm]
    centre: wp.array(dtype=wp.vec3)  # (W·C) centres of the colliding spheres [µm]
    group: wp.array(dtype=wp.int32)  # (W·C) world of each
    largest: float  # radius of the largest colliding sphere [µm]
    reach: float  # longest range of adhesion [µm]


@wp.struct
class PushData:
    """What the contacts move in a step."""

    linear: wp.array2d(dtype=wp.vec3)  # (W, B) [µm]
    angular: wp.array2d(dtype=wp.vec3)  # (W, B), (W, 0) without rotation [rad]


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
