"""What chains of hands are made of, on a device: constants of each, state of each, what goes in and out; all arrays.

`chain` takes a period of them, twin of `otwarp.haptics.chain.chain.Chain.step`.
"""

from __future__ import annotations

import warp as wp

from otwarp.operators.kernels.local_model import Felt, ModelState, Published, Spheres
from otwarp.operators.kernels.motion import MotionConstants, MotionState
from otwarp.operators.kernels.paper_mode import PaperConstants, PaperCurve, PaperState
from otwarp.operators.kernels.passivity import PassivityConstants, PassivityState
from otwarp.operators.kernels.safety import SafetyConstants, SafetyState
from otwarp.operators.kernels.velocity import VelocityState, Window

CAUSES = (
    "",
    "the device's position is not finite",
    "the servo's time is not finite",
    "the simulation's state is not finite",
    "the force is not finite",
    "the hand's motion is not finite",
    "nothing new from the simulation",
    "nothing new from the device",
)
"""Why a hand has disarmed by itself, by code; "" since it was armed."""
PLACE, TIME, STATE, FORCE, MOTION, SIMULATION_SILENT, DEVICE_SILENT = range(1, len(CAUSES))


@wp.struct
class ChainConstants:
    """Of one hand."""

    period: wp.float64  # [s]
    quantum: wp.float64  # of the device's position [m]
    damping: wp.float64  # of the hand [N·s/m]
    back: wp.mat33d  # Aᵀ, from the scene's axes to the device's
    alpha: wp.float64  # of the force filter
    disarm_after: wp.float64  # [s]


@wp.struct
class ChainState:
    """Of one hand of one world."""

    time: wp.float64  # of the last step [s]
    timed: wp.int32  # whether there was one
    elapsed: wp.float64  # time since the step before [s]
    beat: wp.int32  # of the state that was taken in last, 0 before the first
    scene_time: wp.float64  # of the last one that was finite [s]
    scene_age: wp.float64  # [s]
    device_age: wp.float64  # [s]
    position: wp.vec3d  # of the hand, the last that was finite [m]
    felt: wp.vec3d  # force of the scene on the hand [N]
    filtered: wp.vec3d  # the same behind its filter, or the release's [N]
    asked: wp.vec3d  # of safety [N]
    holds: wp.int32  # whether the hand has hold of its traps
    cause: wp.int32  # index into `CAUSES`


@wp.struct
class Ports:
    """What goes in and out of the chains, (W, H) unless said otherwise."""

    hand: wp.array2d(dtype=wp.vec3d)  # in: where the device is [m]
    fresh: wp.array2d(dtype=wp.int32)  # in: whether it has spoken since the last period
    buttons: wp.array2d(dtype=wp.int32)  # in
    elapsed: wp.array(dtype=wp.float64)  # in: (W) time since the last period [s]
    force_gain: wp.array2d(dtype=wp.float64)  # in: [N/pN]
    force: wp.array2d(dtype=wp.vec3d)  # out: sent [N]
    asked: wp.array2d(dtype=wp.vec3d)  # out: asked of safety [N]
    commanded: wp.array2d(dtype=wp.vec3d)  # out: (W, all traps) [µm]
    energy: wp.array2d(dtype=wp.float64)  # out: [J]
    phase: wp.array2d(dtype=wp.int32)  # out: index into `STATES`
    holds: wp.array2d(dtype=wp.int32)  # out: whether the hand has hold of its traps
    cause: wp.array2d(dtype=wp.int32)  # out: index into `CAUSES`


@wp.struct
class ChainData:
    """All arrays of chains: constants (H), states (W·H), and their surroundings."""

    ports: Ports
    published: Published
    felt: Felt
    spheres: Spheres
    window: Window
    constants: wp.array(dtype=ChainConstants)
    motion_constants: wp.array(dtype=MotionConstants)
    passivity_constants: wp.array(dtype=PassivityConstants)
    safety_constants: wp.array(dtype=SafetyConstants)
    paper_constants: wp.array(dtype=PaperConstants)
    paper_curve: wp.array2d(dtype=PaperCurve)  # (H, K)
    kind: wp.array(dtype=wp.int32)  # (S) of each sphere
    state: wp.array(dtype=ChainState)
    motion: wp.array(dtype=MotionState)
    velocity: wp.array(dtype=VelocityState)
    model: wp.array(dtype=ModelState)
    passivity: wp.array(dtype=PassivityState)
    safety: wp.array(dtype=SafetyState)
    paper: wp.array(dtype=PaperState)
