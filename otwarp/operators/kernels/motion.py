"""How the traps follow the hand: twin of `otwarp.haptics.chain.motion`, without the velocity."""

import warp as wp

from otwarp.operators.kernels.features import ChainFeatures


@wp.struct
class MotionConstants:
    """Of one hand."""

    carry: wp.mat33d  # motion gain times axis map [µm/m]
    longest: wp.float64  # step of the traps in one period [µm]
    alpha: wp.float64  # of the low-pass of the commanded motion
    coupling_stiffness: wp.float64  # k_c [N/m]
    coupling_damping: wp.float64  # b_c times the servo rate [N/m]


@wp.struct
class MotionState:
    """Of one hand of one world."""

    hand: wp.vec3d  # where it was last, or where it took hold [m]
    met: wp.int32  # whether that is known
    carried: wp.vec3d  # how far the traps are where the force is evaluated [µm]
    commanded: wp.vec3d  # how far the simulation is told that they are [µm]
    coupled: wp.vec3d  # hand of the virtual coupling's last period [m]
    proxy: wp.vec3d  # [m]
    proxied: wp.int32  # whether these two are known


@wp.func
def low_passed(alpha: wp.float64, value: wp.vec3d, sample: wp.vec3d) -> wp.vec3d:
    """The next value of a low-pass filter of a vector, in the sample's units: value + α·(sample − value)."""
    return value + alpha * (sample - value)


@wp.func
def let_go(state: MotionState) -> MotionState:
    """Nothing carried yet [µm], and the next place of the hand is where it takes hold."""
    out = state
    out.met = 0
    out.proxied = 0
    out.carried = wp.vec3d()
    out.commanded = wp.vec3d()
    return out


@wp.func
def coupled_proxy(constants: MotionConstants, state: MotionState, hand: wp.vec3d, force: wp.vec3d) -> MotionState:
    """The proxy [m] drawn by the hand [m] through spring and damper, and by the scene's last force on the hand [N]."""
    out = state
    if out.proxied == 0:
        out.proxied = 1
        out.coupled = hand
        out.proxy = hand
    k = constants.coupling_stiffness
    b = constants.coupling_damping
    s = wp.float64(1.0) / (k + b)
    out.proxy = s * (b * (out.proxy + hand - out.coupled) + k * hand + force)
    out.coupled = hand
    return out


def carrying(features: ChainFeatures) -> wp.Function:
    """`(constants, state, place, holds) -> state`: the traps carried to where the hand takes them, if it holds them."""

    @wp.func
    def carry(constants: MotionConstants, state: MotionState, place: wp.vec3d, holds: wp.int32) -> MotionState:
        """Motion of the traps [µm] for the hand, or its proxy, at a place [m]."""
        out = state
        if out.met == 0:
            out.met = 1
            out.hand = place
        if wp.static(features.absolute):
            if holds != 0:
                out.carried = constants.carry * (place - out.hand)
        else:
            if holds != 0:
                step = constants.carry * (place - out.hand)
                if wp.static(features.slowed):
                    length = wp.length(step)
                    if length > constants.longest:
                        step = (constants.longest / length) * step
                out.carried = out.carried + step
            out.hand = place
        if wp.static(features.motion_filter):
            out.commanded = low_passed(constants.alpha, out.commanded, out.carried)
        else:
            out.commanded = out.carried
        return out

    return carry
