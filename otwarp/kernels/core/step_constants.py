"""What one time step needs to know of a body and its traps: made once, kept in registers over a loop of steps."""

import warp as wp

from otwarp.kernels.core.keyframes import Piece
from otwarp.kernels.core.table_data import GridLevel
from otwarp.kernels.core.types import vec6


@wp.struct
class TrapConstants:
    """What one trap does to spheres of one radius and kind: made once, kept in registers over a loop of steps.

    A model fills what its force reads; the rest costs nothing, because terms are inlined.
    """

    model: wp.int32  # key of the force term
    axis: wp.vec3
    side: wp.vec3
    up: wp.vec3
    equilibrium: wp.float32  # [µm]
    # an authored law, scaled to the sphere's radius
    stiffness: wp.float32  # [pN/µm/mW]
    threshold2: wp.float32  # squared [µm²]
    inverse_square: wp.float32  # [pN·µm²/mW]
    offset: wp.float32  # [pN/mW]
    cutoff2: wp.float32  # squared [µm²]
    axial_stiffness: wp.float32
    axial_threshold2: wp.float32
    axial_inverse_square: wp.float32
    axial_offset: wp.float32
    axial_cutoff2: wp.float32
    reach2: wp.float32  # the larger of the two squared cutoffs [µm²]
    table: wp.int32  # index of the force table
    finest: GridLevel


@wp.struct
class Glide:
    """How the focus of a trap goes on from where it is commanded."""

    velocity: wp.vec3  # [µm/s]
    since: wp.float64  # time at which it is where it is commanded [s]


@wp.struct
class BeadConstants:
    """What one time step needs to know of a lone sphere, made once, kept in registers over a loop of steps."""

    mobility_dt: wp.float32  # mobility × time step [µm/pN]
    spread: wp.float32  # standard deviation of the thermal displacement [µm]
    weight: wp.float32  # [pN]
    drag_radius: wp.float32  # with a flow: of its hydrodynamic sphere [µm]
    trapped: wp.int32  # 1: traps act on it
    radius: wp.float32  # [µm]
    kind: wp.int32
    # of the first two traps, where a scene has no more
    first: TrapConstants
    second: TrapConstants
    # equilibrium point [µm] and power [mW] of traps that stay where they are; of others the focus when not followed
    first_anchor: wp.vec4
    second_anchor: wp.vec4
    first_glide: Glide  # of traps that glide
    second_glide: Glide
    first_piece: Piece  # of traps that follow samples: not constant, but for many steps
    second_piece: Piece
    # of the `lanes` form
    deviates: wp.uint64  # where in a block of noise the deviates of step 0 would be


@wp.struct
class RigidConstants:
    """What one time step needs to know of a rigid body, in its own frame: M dt about the centre of diffusion.

    Symmetric blocks as (xx, yy, zz, xy, xz, yz), lower triangles as (xx, yy, zz, yx, zx, zy).
    """

    translation: vec6  # [µm/pN]
    coupling: vec6  # [1/pN], symmetric about the centre of diffusion
    rotation: vec6  # [1/pN/µm]
    translation_root: vec6  # lower factor of 2 k_B T M dt, block by block [µm]; rotations as in `rotational_noise`
    coupling_root: wp.mat33
    rotation_root: vec6
    aims: wp.mat44  # equilibrium point [µm] and power [mW] of the first traps, where these stay where they are
    reaches: wp.vec4  # squared distance up to which they act [µm²]
    # where `near_traps` lists which of them may reach which spheres
    rows: wp.uint64  # address of what `thread_rows` keeps
    bound: wp.float32  # radius of the bounding sphere [µm]
    leeway: wp.float32  # how far points of the body may go until the list is made anew [µm]
    pairs: wp.int32  # how many are listed
    listed: wp.int32  # 0: all are to be looked at
    # of the `lanes` form
    kept: wp.uint64  # address of what `rigid_block` lays out
    kicks: wp.uint64  # where in a block of thermal moves, in the body's frame, that of step 0 would be


@wp.struct
class BodyConstants:
    """Those of a body of either kind; the other kind's are zero."""

    turns: wp.int32  # 1: a rigid body
    bead: BeadConstants
    rigid: RigidConstants
