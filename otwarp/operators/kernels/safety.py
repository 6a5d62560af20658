"""What stands between the chain and the motors: twin of `otwarp.haptics.chain.safety.Safety`."""

import warp as wp

from otwarp.haptics.chain.safety import BELOW, COOL, ROUNDING, SILENT
from otwarp.haptics.core import STATES

DISARMED, RAMPING, ARMED, DECAYING, FAULT = range(len(STATES))
"""Codes of phases, the order of `otwarp.haptics.core.STATES`."""


@wp.struct
class SafetyConstants:
    """Of one hand."""

    period: wp.float64  # [s]
    ramp_time: wp.float64  # [s]
    slew: wp.float64  # [N/s]
    clamp: wp.float64  # [N]
    continuous: wp.float64  # force that the motors bear for ever [N]
    thermal_time: wp.float64  # [s]
    decay_after: wp.float64  # [s]
    disarm_after: wp.float64  # [s]


@wp.struct
class SafetyState:
    """Of one hand of one world."""

    force: wp.vec3d  # last one sent [N]
    held: wp.vec3d  # what falls after a fault, before the gain [N]
    gain: wp.float64
    ceiling: wp.float64  # of a falling force, before the gain [N]
    heat: wp.float64  # mean square force [N²]
    wanted: wp.int32
    faulty: wp.int32
    phase: wp.int32


@wp.func
def cold_safety() -> SafetyState:
    """Disarmed, no force [N], no heat."""
    out = SafetyState()
    out.ceiling = wp.float64(wp.inf)
    out.phase = wp.static(DISARMED)
    return out


@wp.func
def at_fault(state: SafetyState) -> SafetyState:
    """Disarmed, with the force that is being sent [N] to fall."""
    out = state
    if out.faulty == 0:
        out.faulty = 1
        out.wanted = 0
        # the fall multiplies by the gain again
        k = wp.float64(0.0)
        if out.gain > wp.float64(0.0):
            k = wp.float64(1.0) / out.gain
        out.held = k * out.force
    return out


@wp.func
def shortened(v: wp.vec3d, length: wp.float64) -> wp.vec3d:
    """A vector brought to a length in its own units, without overflow for any finite numbers."""
    largest = wp.max(wp.max(wp.abs(v[0]), wp.abs(v[1])), wp.abs(v[2]))
    out = wp.vec3d()
    if largest != wp.float64(0.0) and length != wp.float64(0.0):
        u = v / largest
        out = (wp.static(wp.float64(BELOW)) * length / wp.length(u)) * u
    return out


@wp.func
def falling(constants: SafetyConstants, state: SafetyState, elapsed: wp.float64, age: wp.float64) -> SafetyState:
    """Lower gain, and the ceiling [N] that keeps a moving hand from raising the force; times in seconds."""
    out = state
    zero = wp.float64(0.0)
    if wp.isinf(out.ceiling):
        out.ceiling = zero
        if out.gain > zero:
            out.ceiling = wp.length(out.force) / out.gain
    # zero two periods before the end, so that the slew limit has nothing left to do there
    left = constants.disarm_after - constants.decay_after - wp.float64(2.0) * constants.period
    span = wp.max(left, constants.period)
    out.gain = wp.max(zero, out.gain - elapsed / span)
    if age >= constants.disarm_after - constants.period - wp.static(wp.float64(ROUNDING)):
        out.gain = zero
    out.phase = wp.static(DECAYING)
    if out.faulty != 0:
        out.phase = wp.static(FAULT)
    return out


@wp.func
def limited(constants: SafetyConstants, state: SafetyState, asked: wp.vec3d, step: wp.float64) -> wp.vec3d:
    """The force [N] within motor guard, slew limit over `step` [s] and clamp."""
    bears = constants.continuous * constants.continuous
    peak = constants.clamp * constants.clamp
    heat = state.heat
    # from the peak while cool, down to what they bear for ever
    limit2 = wp.min(peak, bears)
    if wp.float64(0.0) < bears and bears < peak and heat < bears:
        limit2 = wp.min(peak, bears + (peak - bears) * (bears - heat) / (wp.static(wp.float64(1.0 - COOL)) * bears))
    if not wp.isinf(state.ceiling):
        most = state.gain * state.ceiling
        limit2 = wp.min(limit2, most * most)
    force = asked
    if not (wp.dot(force, force) <= limit2):
        force = shortened(force, wp.sqrt(limit2))
    change = force - state.force
    longest = constants.slew * step
    if wp.dot(change, change) > longest * longest:
        force = state.force + shortened(change, longest)
    # both ends of a limited change are within the clamp, and so is what lies between, but for rounding
    if wp.dot(force, force) > peak:
        force = shortened(force, constants.clamp)
    return force


@wp.func
def gained(
    constants: SafetyConstants, state: SafetyState, elapsed: wp.float64, age: wp.float64, allowed: wp.int32
) -> SafetyState:
    """Gain and phase of this period: ramped in, or falling for what is stale, forbidden or at fault; times [s]."""
    out = state
    step = wp.min(elapsed, constants.period)
    # ages are sums of periods, and rounded
    stale = age >= constants.decay_after - wp.static(wp.float64(ROUNDING))
    if age >= constants.disarm_after - wp.static(wp.float64(ROUNDING)):
        out.wanted = 0
    if out.wanted != 0 and allowed != 0 and not stale:
        one = wp.float64(1.0)
        out.ceiling = wp.float64(wp.inf)
        if constants.ramp_time > wp.float64(0.0):
            out.gain = wp.min(one, out.gain + step / constants.ramp_time)
        else:
            out.gain = one
        out.phase = wp.static(RAMPING)
        if out.gain == one:
            out.phase = wp.static(ARMED)
    else:
        out = falling(constants, out, elapsed, age)
    return out


@wp.func
def sent(constants: SafetyConstants, state: SafetyState, force: wp.vec3d, elapsed: wp.float64) -> SafetyState:
    """The state with the force [N] that is sent, `elapsed` [s] after the last: heat, and whether all has fallen."""
    out = state
    share = wp.min(elapsed, constants.period) / constants.thermal_time
    out.heat = out.heat + wp.min(share, wp.float64(1.0)) * (wp.dot(force, force) - out.heat)
    out.force = force
    largest = wp.max(wp.max(wp.abs(force[0]), wp.abs(force[1])), wp.abs(force[2]))
    if out.wanted == 0 and out.faulty == 0 and largest <= wp.static(wp.float64(SILENT)):
        out.phase = wp.static(DISARMED)
    return out
