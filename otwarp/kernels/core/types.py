"""The structs that kernels read and write. Units are the internal ones (µm, s, pN, mW, K).

Shapes: W worlds, T traps, B bodies, S trapped spheres, C colliding spheres, O obstacles. An array marked `(1|W, n)`
holds one row for all worlds or one row per world. Arrays always exist; a scene without a term has them with length 0.
"""

import warp as wp

from otwarp.kernels.core.exact_data import ExactData
from otwarp.kernels.core.table_data import ForceTableData

vec4 = wp.vec4
mat66 = wp.types.matrix(shape=(6, 6), dtype=wp.float32)
vec6 = wp.types.vector(length=6, dtype=wp.float32)


@wp.struct
class MediumData:
    """Thermal energy k_B·T [pN·µm] and viscosity [pN·s/µm²], each (1|W)."""

    thermal_energy: wp.array(dtype=wp.float32)
    viscosity: wp.array(dtype=wp.float32)


@wp.struct
class StepTimes:
    """The steps at whose times key frames have been looked up, once for all worlds."""

    first: wp.array(dtype=wp.int64)  # (1) number of the step in the first row
    per_second: wp.float64  # steps [1/s]


@wp.struct
class TrapData:
    """Constants of the traps; forces are per mW of trap power."""

    model: wp.array(dtype=wp.int32)  # (T) key of kernels.optics.traps.TRAP_TERMS
    axis: wp.array(dtype=wp.vec3)  # (T) beam direction
    side: wp.array(dtype=wp.vec3)  # (T) across it, along the major axis of the polarization
    # (T, optical kinds) what a trap reads of its force table before any node, so that two reads find it
    near_nodes: wp.array2d(dtype=wp.vec4i)  # index of the table; first node and columns of its finest level; 0
    near_grid: wp.array2d(dtype=wp.vec4)  # radius, 1/spacing and middle of that level; `equilibrium` of the trap
    tables: ForceTableData
    exact: wp.array(dtype=ExactData)  # one per table, (0) without exact traps
    exact_scale: wp.array(dtype=wp.float32)  # (tables) force per mW of Q = 1 [pN]
    equilibrium: wp.array(dtype=wp.float32)  # (T) along the axis, from the focus [µm]
    law_radius: wp.array(dtype=wp.float32)  # (T) sphere radius the law holds for [µm], 0: any
    stiffness: wp.array2d(dtype=wp.float32)  # (1|W, T) radial or isotropic K [pN/µm/mW]
    threshold: wp.array2d(dtype=wp.float32)  # (1|W, T) δ [µm]
    inverse_square: wp.array2d(dtype=wp.float32)  # (1|W, T) A [pN·µm²/mW]
    offset: wp.array2d(dtype=wp.float32)  # (1|W, T) C [pN/mW]
    cutoff: wp.array2d(dtype=wp.float32)  # (1|W, T) [µm]
    axial_stiffness: wp.array2d(dtype=wp.float32)  # the same along the beam
    axial_threshold: wp.array2d(dtype=wp.float32)
    axial_inverse_square: wp.array2d(dtype=wp.float32)
    axial_offset: wp.array2d(dtype=wp.float32)
    axial_cutoff: wp.array2d(dtype=wp.float32)
    speed_limit: wp.array2d(dtype=wp.float32)  # (1|W, T) [µm/s]
    key_start: wp.array(dtype=wp.int32)  # (T + 1) first key of each trap
    key_time: wp.array(dtype=wp.float64)  # (keys) [s]
    key_value: wp.array(dtype=wp.vec4)  # (keys) focus [µm] and power [mW]
    stage_start: wp.array(dtype=wp.int32)  # the same as the stages of a step see it; (0) where that is no different
    stage_time: wp.array(dtype=wp.float64)
    stage_value: wp.array(dtype=wp.vec4)
    step_times: StepTimes
    step_value: wp.array2d(dtype=wp.vec4)  # (rows, T) by the key frames then; (0, 0) where each thread looks
    hand: wp.array(dtype=wp.int32)  # (T) 0 none, 1 left, 2 right
    held_body: wp.array(dtype=wp.int32)  # (T) body of the sphere it holds, -1 none
    held_offset: wp.array(dtype=wp.vec3)  # (T) offset of that sphere in its body [µm]
    held_mobility: wp.array(dtype=wp.float32)  # (T) mean mobility of that sphere's centre at unit viscosity [1/µm]
    held_range: wp.array2d(dtype=wp.float32)  # (1|W, T) distance at which that sphere has escaped [µm]


@wp.struct
class BodyData:
    """Constants of the bodies; offsets are in the body frame, from the reference point (centre of diffusion)."""

    shape: wp.array(dtype=wp.int32)  # (B) index into the mobility arrays
    rigid: wp.array(dtype=wp.int32)  # (B) 1: full 6×6 mobility with rotation, 0: a lone sphere
    translation: wp.array(dtype=wp.float32)  # (shapes) mobility of a lone sphere at unit viscosity [1/µm]
    mobility: wp.array(dtype=mat66)  # (shapes) at unit viscosity, body frame
    cholesky: wp.array(dtype=mat66)  # (shapes) lower factor of `mobility`
    resistance: wp.array(dtype=mat66)  # (shapes) inverse of `mobility`
    weight: wp.array(dtype=wp.float32)  # (B) weight minus buoyancy [pN]
    weight_arm: wp.array(dtype=wp.vec3)  # (B) centroid, where it acts [µm]; (0) when no body rotates
    bound: wp.array(dtype=wp.float32)  # (B) radius of the bounding sphere [µm]
    largest: wp.array(dtype=wp.float32)  # (B) radius of the largest trapped sphere [µm]
    trapped_start: wp.array(dtype=wp.int32)  # (B + 1)
    trapped: wp.array(dtype=wp.vec4)  # (S) offset and radius of the spheres that traps act on
    trapped_kind: wp.array(dtype=wp.int32)  # (S) optical kind: spheres of equal radius and index
    drag_start: wp.array(dtype=wp.int32)  # (B + 1), filled when there is flow
    drag_sphere: wp.array(dtype=wp.vec4)  # offset and radius of the spheres that couple to the flow
    flow_coupling: wp.array(dtype=mat66)  # their share of the body's velocity, body frame


@wp.struct
class ContactData:
    """Constants of contact."""

    start: wp.array(dtype=wp.int32)  # (B + 1)
    sphere: wp.array(dtype=wp.vec4)  # (C) offset (of a rod: of its middle) and radius of what collides
    half: wp.array(dtype=wp.vec3)  # (C) from the middle of a rod to its end [µm], 0 for a sphere; (0) without rods
    body: wp.array(dtype=wp.int32)  # (C) body of each
    compliance: wp.array(dtype=wp.float32)  # (B) (1 − ν²)/E [µm²/pN]
    adhesion: wp.array(dtype=wp.float32)  # (B) work of adhesion [pN/µm]
    adhesion_range: wp.array(dtype=wp.float32)  # (B) [µm]


@wp.struct
class ObstacleData:
    """Constants and key frames of the obstacles."""

    shape: wp.array(dtype=wp.int32)  # (O) key of kernels.contact.obstacles.SHAPES
    size: wp.array(dtype=wp.vec3)  # (O) [µm]
    mesh: wp.array(dtype=wp.uint64)  # (O) wp.Mesh id or 0
    sheet: wp.array(dtype=wp.int32)  # (O) 1: a mesh that is not closed, solid from both sides
    bound: wp.array(dtype=wp.float32)  # (O) radius of the bounding sphere about its origin [µm]
    key_start: wp.array(dtype=wp.int32)  # (O + 1)
    key_time: wp.array(dtype=wp.float64)  # [s]
    key_position: wp.array(dtype=wp.vec3)  # [µm]
    key_rotation: wp.array(dtype=wp.quat)
    step_times: StepTimes
    step_position: wp.array2d(dtype=wp.vec3)  # (rows, O) by the key frames then [µm]; (0, 0) where each thread looks
    step_rotation: wp.array2d(dtype=wp.quat)


@wp.struct
class FlowData:
    """The background flow, along the x axis of its frame and varying along z, and along y in a rectangular channel."""

    origin: wp.vec3  # of the frame [µm]
    rotation: wp.quat  # from the frame's axes to the world's
    half_height: wp.float32  # of a channel, along z [µm]
    half_width: wp.float32  # of a rectangular channel, the longer side [µm]
    drive: wp.float32  # of a rectangular channel, pressure gradient over viscosity and speed [1/µm²]
    speed: wp.array(dtype=wp.float32)  # (1|W) [µm/s]
    shear_rate: wp.array(dtype=wp.float32)  # (1|W) [1/s]
    # of a velocity field: nodes of a grid, z fastest
    low: wp.vec3  # first node [µm]
    per_spacing: wp.vec3  # [1/µm]
    last: wp.vec3  # indices of the last node
    repeat: wp.vec3  # cells after which it repeats, 0 along an open axis
    node: wp.array2d(dtype=wp.vec3)  # (nodes, 3) u [µm/s], ½∇×u [1/s], ⅙∇²u [1/(µm·s)]; (0, 3) without one


@wp.struct
class WallData:
    """No-slip planes that hinder motion, and the spheres that feel them; all of length 0 without such walls."""

    normal: wp.array(dtype=wp.vec3)  # (walls) unit normal into the liquid
    offset: wp.array(dtype=wp.float32)  # (walls) normal·point of the plane [µm]
    start: wp.array(dtype=wp.int32)  # (B + 1)
    sphere: wp.array(dtype=wp.vec4)  # offset from the reference point, body frame, and radius [µm]
    turned_back: wp.array(dtype=wp.int32)  # 1: the wall stops it, because no contact does


@wp.struct
class CouplingData:
    """What coupled bodies need to know of each other, by shape, body frame, unit viscosity; length 0 without coupling.

    M is the mobility about the centre of diffusion, R = M⁻¹; t and r are translation and rotation.
    """

    radius: wp.array(dtype=wp.float32)  # of the sphere with the largest drag of the body in any direction [µm]
    given_turning: wp.array(dtype=wp.mat33)  # (R_tt)⁻¹ [1/µm]; this and the rest (0) without rotation
    with_turning: wp.array(dtype=wp.mat33)  # M_tr M_rr⁻¹ [µm]
    turning_root: wp.array(dtype=wp.mat33)  # lower factor of M_rr [1/µm^{3/2}]


@wp.struct
class ForceData:
    """Parameters of the forces in `Features.forces`, and the spheres that some of them act on; P parameters in all."""

    value: wp.array(dtype=wp.float32)  # one parameter after the other, each (1|W, B, components)
    layout: wp.array(dtype=wp.int32)  # (2 P) first number and rows of each parameter, then per force and body: it acts
    sphere_start: wp.array(dtype=wp.int32)  # (B + 1), filled where a force acts on the spheres of rigid bodies
    sphere: wp.array(dtype=wp.vec4)  # offset from the reference point and radius [µm]


@wp.struct
class ForceInput:
    """What a force may depend on: a body, or one sphere of it, at one moment."""

    position: wp.vec3  # the body's centre of diffusion, or the sphere's centre [µm]
    rotation: wp.quat  # from the body's frame to the world's
    radius: wp.float32  # of the sphere, or of the ball about the centre of diffusion that holds the body [µm]
    time: wp.float32  # [s]
    exact_time: wp.float64  # the same, for runs so long that float32 seconds are too coarse [s]
    thermal_energy: wp.float32  # k_B·T [pN·µm]
    viscosity: wp.float32  # [pN·s/µm²]
    world: wp.int32  # index of the world
    body: wp.int32  # index of the body in the scene


@wp.struct
class PeriodData:
    """The cell that repeats in space; all zero along an open axis."""

    low: wp.vec3  # its lower corner [µm]
    length: wp.vec3  # [µm]
    per_length: wp.vec3  # [1/µm]


@wp.struct
class InletData:
    """Where cells leave the scene, and where they come in again."""

    domain_low: wp.vec3  # corners of the domain [µm], -inf and inf along an axis without end
    domain_high: wp.vec3
    low: wp.vec3  # lower corner of the inlet [µm]
    size: wp.vec3  # its edges [µm]
    recycled: wp.array(dtype=wp.int32)  # (B) 1: a cell, which comes in again


@wp.struct
class WorldsData:
    """Worlds with clocks of their own: the one part of a model that changes, between launches."""

    number: wp.array(dtype=wp.uint32)  # (W) of the trial that a world runs: what its noise goes by
    step: wp.array(dtype=wp.int64)  # (W) steps since it was started or reset
    done: wp.array(dtype=wp.int32)  # (W) 0 in motion, else why it ended
    living: wp.array(dtype=wp.int32)  # (W) worlds in motion, in the first `count` places
    count: wp.array(dtype=wp.int32)  # (2) how many these are, and how many were left when the last segment ended


@wp.struct
class ModelData:
    """All that never changes during a run."""

    time_step: wp.float64  # [s]
    seed: wp.uint32
    first_world: wp.int32  # number of this part's world 0 among all worlds
    bodies: wp.int32
    period: PeriodData
    medium: MediumData
    traps: TrapData
    body: BodyData
    contact: ContactData
    obstacles: ObstacleData
    flow: FlowData
    walls: WallData
    coupling: CouplingData
    forces: wp.array(dtype=ForceData)  # (1), (0) without forces that have parameters: the model stays small
    worlds: wp.array(dtype=WorldsData)  # (1), (0) without episodes
    inlets: wp.array(dtype=InletData)  # (1), (0) without an inlet


@wp.struct
class ControlData:
    """What an operator commands."""

    trap_position: wp.array2d(dtype=wp.vec3)  # (1|W, T) [µm]
    trap_power: wp.array2d(dtype=wp.float32)  # (1|W, T) [mW]
    follow: wp.array(dtype=wp.int32)  # (T) bit 0: position follows the scene's key frames, bit 1: power does
    trap_velocity: wp.array2d(dtype=wp.vec3)  # (W, T) at which positions go on [µm/s], (0, 0) where none glides
    trap_since: wp.array(dtype=wp.float64)  # (W) time of a world since when they do [s], (0) likewise


@wp.struct
class StateData:
    """What moves; `position` is that of the reference point of each body."""

    position: wp.array2d(dtype=wp.vec3)  # (W, B) [µm]
    orientation: wp.array2d(dtype=wp.quat)  # (W, B), (W, 0) without rotation
    trap_position: wp.array2d(dtype=wp.vec3)  # (W, T) actual foci, (W, 0) without speed limits [µm]
    image: wp.array2d(dtype=wp.vec3i)  # (W, B) cells that each body has gone on, (W, 0) in open space


@wp.struct
class ReadoutData:
    """What the last step measured, and what it found wrong."""

    contact_force: wp.array2d(dtype=wp.vec3)  # (W, B) net contact force [pN]
    contact_load: wp.array2d(dtype=wp.float32)  # (W, B) sum of the normal forces [pN]
    entries: wp.array2d(dtype=wp.int32)  # (W, B) how often each has come in again, (W, 0) without an inlet
    escape_step: wp.array2d(dtype=wp.int64)  # (W, T) first step at which the held sphere was out of reach, or -1
    fault: wp.array2d(dtype=wp.int32)  # (W, B) code of kernels.core.faults, 0 good
    fault_step: wp.array2d(dtype=wp.int64)  # (W, B)
    fault_count: wp.array(dtype=wp.int32)  # (1) not 0: some body has a fault


@wp.struct
class WorldNow:
    """What the end of a world's task may depend on."""

    world: wp.int32  # index of the world, the row of the arrays
    step: wp.int64  # steps since it was started or reset
    time: wp.float32  # the same in seconds
    state: StateData
    readout: ReadoutData


@wp.struct
class Aim:
    """One trap as one body sees it."""

    anchor: wp.vec3  # equilibrium point [µm]
    power: wp.float32  # [mW]
    reach2: wp.float32  # squared distance beyond which it does nothing [µm²], 0 where it reaches no sphere of the body


@wp.struct
class Wrench:
    """Force [pN] and torque about the reference point [pN·µm], world axes."""

    force: wp.vec3
    torque: wp.vec3


@wp.struct
class Move:
    """Displacement [µm] and rotation vector [rad] of one step, world axes."""

    linear: wp.vec3
    angular: wp.vec3


@wp.struct
class Pose:
    """Position [µm] and orientation."""

    position: wp.vec3
    rotation: wp.quat


@wp.func
def world_row(rows: int, world: int) -> int:
    """Row of a `(1|W, n)` array that serves `world`: without a division, which would cost more than the term."""
    return wp.where(rows == 1, 0, world)
