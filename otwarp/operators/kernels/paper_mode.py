"""The public release's force node: twin of `otwarp.haptics.chain.paper_mode`."""

import warp as wp

from otwarp.haptics.chain.paper_mode import TOUCHING
from otwarp.operators.kernels.motion import low_passed


@wp.struct
class PaperConstants:
    """Of one hand."""

    alpha: wp.float64  # of the force filter, per message
    distance_damping: wp.float64  # D [raw force·s/µm]
    messages: wp.int32  # per published state
    trap: wp.int32  # the hand's first, in the scene


@wp.struct
class PaperCurve:
    """Eq. 1 of a kind of sphere in a hand's first trap, per mW."""

    stiffness: wp.float64  # [pN/µm]
    threshold: wp.float64  # [µm]
    inverse_square: wp.float64  # [pN·µm²]
    offset: wp.float64  # [pN]
    cutoff: wp.float64  # [µm]


@wp.struct
class PaperState:
    """Of one hand of one world."""

    trap: wp.vec3d  # as last heard of [µm]
    robot: wp.vec3d  # [µm]
    heard: wp.int32  # whether the robot was
    sphere: wp.int32  # which one is the robot, -1 before it was chosen
    distance: wp.float64  # at the last message [µm]
    time: wp.float64  # of it [s]
    spoke: wp.int32  # whether these two are known
    filtered: wp.vec3d  # raw force
    force: wp.vec3d  # on the hand, in the scene's axes [N]


@wp.func
def unheard() -> PaperState:
    """A node as at its start: no message yet, no force [N]."""
    out = PaperState()
    out.sphere = -1
    return out


@wp.func
def raw_pull(curve: PaperCurve, power: wp.float64, distance: wp.float64) -> wp.float64:
    """Pull of eq. 1 in raw units at a distance [µm], for a power [mW]."""
    pull = wp.float64(0.0)
    if distance < curve.threshold:
        pull = power * curve.stiffness * distance
    elif distance < curve.cutoff:
        pull = power * (curve.inverse_square / (distance * distance) + curve.offset)
    return pull


@wp.func
def message(
    constants: PaperConstants, state: PaperState, curve: PaperCurve, power: wp.float64, gain: wp.float64,
    time: wp.float64,
) -> PaperState:  # fmt: skip
    """The node publishes at `time` [s], with G_hand = `gain` [N per raw unit] and the trap's power [mW]."""
    out = state
    apart = state.robot - state.trap
    distance = wp.length(apart)
    if distance > wp.static(wp.float64(TOUCHING)):
        raw = raw_pull(curve, power, distance)
        if state.spoke != 0 and time > state.time:
            raw = raw - constants.distance_damping * (distance - state.distance) / (time - state.time)
        out.spoke = 1
        out.distance = distance
        out.time = time
        out.filtered = low_passed(constants.alpha, state.filtered, (raw / distance) * apart)
        out.force = gain * out.filtered
    return out


@wp.func
def nearest(spheres: wp.array2d(dtype=wp.vec3d), world: int, place: wp.vec3d) -> int:
    """Which sphere of a world is nearest to a place [µm], the first of several."""
    found = int(0)
    least = wp.float64(wp.inf)
    for k in range(spheres.shape[1]):
        distance = wp.length(spheres[world, k] - place)
        if distance < least:
            least = distance
            found = k
    return found


@wp.func
def published(
    constants: PaperConstants, state: PaperState, curve: PaperCurve, trap: wp.vec3d, power: wp.float64,
    robot: wp.vec3d, gain: wp.float64, time: wp.float64,
) -> PaperState:  # fmt: skip
    """Both messages of a published state: the trap is here [µm] with a power [mW], the robot there, at `time` [s]."""
    out = state
    out.trap = trap
    if constants.messages != 1 and state.heard != 0:
        out = message(constants, out, curve, power, gain, time)
    out.robot = robot
    out.heard = 1
    return message(constants, out, curve, power, gain, time)
