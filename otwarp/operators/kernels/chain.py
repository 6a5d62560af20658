"""One servo period of all hands of all worlds: twin of `otwarp.haptics.chain.chain.Chain.step`.

velocity → coupling → motion → force sum → gain → filter → damping → passivity → safety, or the release's node between
motion and safety. A thread is one hand of one world.
"""

from __future__ import annotations

import functools

import warp as wp

from otwarp.haptics.chain.chain import CLUTCH, DEAD_MAN
from otwarp.operators.kernels.chain_data import (
    DEVICE_SILENT,
    FORCE,
    MOTION,
    PLACE,
    SIMULATION_SILENT,
    STATE,
    TIME,
    ChainData,
    ChainState,
)  # fmt: skip
from otwarp.operators.kernels.features import ChainFeatures
from otwarp.operators.kernels.local_model import (
    all_finite,
    is_finite,
    pulling,
    taking_in,
)  # fmt: skip
from otwarp.operators.kernels.motion import (
    carrying,
    coupled_proxy,
    let_go,
    low_passed,
)  # fmt: skip
from otwarp.operators.kernels.paper_mode import PaperState, nearest, published, unheard
from otwarp.operators.kernels.passivity import (
    bounded,
    controlled,
    observe,
    send,
)  # fmt: skip
from otwarp.operators.kernels.safety import (
    at_fault,
    gained,
    limited,
    sent,
)  # fmt: skip
from otwarp.operators.kernels.velocity import VelocityState, estimating


@wp.func
def unstarted() -> ChainState:
    """Before the first step: no time [s], no state taken in."""
    out = ChainState()
    out.scene_time = wp.float64(-wp.inf)
    return out


@wp.func
def fault(data: ChainData, state: ChainState, n: int, cause: int) -> ChainState:
    """The state with its traps let go and its force [N] to fall, for a cause."""
    out = state
    out.cause = cause
    out.holds = 0
    data.safety[n] = at_fault(data.safety[n])
    return out


@wp.func
def hear(data: ChainData, state: ChainState, w: int, h: int, n: int) -> ChainState:
    """Take in what the clock [s] and the device [m] say, and count the work of the force that was held."""
    out = state
    out.elapsed = data.constants[h].period
    time = state.time + data.ports.elapsed[w]
    since = time - state.time
    if wp.isfinite(time):
        out.time = time
        out.timed = 1
        # one period at first, and after a clock that ran backwards
        if state.timed != 0 and since >= wp.float64(0.0):
            out.elapsed = since
    else:
        out = fault(data, out, n, wp.static(TIME))
    fresh = data.ports.fresh[w, h]
    out.scene_age = state.scene_age + out.elapsed
    out.device_age = state.device_age + out.elapsed
    if fresh != 0:
        out.device_age = wp.float64(0.0)
    place = data.ports.hand[w, h]
    if is_finite(place):
        out.position = place
    else:
        out = fault(data, out, n, wp.static(PLACE))
        fresh = 0
    data.passivity[n] = observe(data.passivity_constants[h], data.passivity[n], out.position, out.elapsed, fresh)
    return out


@wp.func
def take_hold(data: ChainData, state: ChainState, n: int) -> ChainState:
    """Forget everything that was carried, filtered or felt [N]."""
    out = state
    out.holds = 1
    out.felt = wp.vec3d()
    out.filtered = wp.vec3d()
    data.motion[n] = let_go(data.motion[n])
    data.velocity[n] = VelocityState()
    data.paper[n] = unheard()
    return out


@wp.func
def on_hand(back: wp.mat33d, sign: wp.float64, force: wp.vec3d) -> wp.vec3d:
    """A force in the scene's axes as one in the device's [N], times `sign`."""
    return (sign * back) * force


@wp.func
def robot_published(data: ChainData, state: PaperState, w: int, h: int, time: wp.float64) -> PaperState:
    """The release's node after both messages of the newest state, at `time` of its clock [s]."""
    constants = data.paper_constants[h]
    out = state
    trap = data.published.trap[w, constants.trap]
    if out.sphere < 0:
        out.sphere = nearest(data.published.sphere, w, trap)
    curve = data.paper_curve[h, data.kind[out.sphere]]
    power = data.published.power[w, constants.trap]
    robot = data.published.sphere[w, out.sphere]
    return published(constants, out, curve, trap, power, robot, data.ports.force_gain[w, h], time)


def summing(features: ChainFeatures) -> wp.Function:
    """`(data, state, w, h, n, new, velocity) -> state`: the force of the traps on the spheres, for every period."""
    pull = pulling(features)

    @wp.func
    def ask(data: ChainData, state: ChainState, w: int, h: int, n: int, new: int, velocity: wp.vec3d) -> ChainState:
        """The state with the force `asked` [N]: gain, filter, damping, passivity control."""
        out = state
        pulled = pull(data.felt, data.spheres, data.model[n], h, n, data.motion[n].carried)
        force = on_hand(data.constants[h].back, -data.ports.force_gain[w, h], pulled)
        out.felt = force
        if wp.static(features.force_filter):
            force = low_passed(data.constants[h].alpha, state.filtered, force)
            out.filtered = force
        if wp.static(features.damping):
            force = force - data.constants[h].damping * velocity
        if wp.static(features.passivity):
            force = controlled(data.passivity_constants[h], data.passivity[n], force, velocity)
        out.asked = force
        return out

    return ask


@wp.func
def ask_release(
    data: ChainData, state: ChainState, w: int, h: int, n: int, new: int, velocity: wp.vec3d
) -> ChainState:  # fmt: skip
    """The state with the force `asked` [N]: the release's node with every new state, its damping; held in between."""
    out = state
    if new != 0:
        paper = robot_published(data, data.paper[n], w, h, state.time)
        data.paper[n] = paper
        force = on_hand(data.constants[h].back, wp.float64(1.0), paper.force)
        out.filtered = force - data.constants[h].damping * velocity
    out.asked = out.filtered
    return out


def rendering(features: ChainFeatures) -> wp.Function:
    """`(data, state, w, h, n, holds, new) -> state`: the force that a chain asks for."""
    estimate, carry = estimating(features), carrying(features)
    ask = ask_release if features.paper else summing(features)

    @wp.func
    def render(data: ChainData, state: ChainState, w: int, h: int, n: int, holds: int, new: int) -> ChainState:
        """The state with the force `asked` [N] for where the hand is now."""
        place = state.position
        velocity = wp.vec3d()
        if wp.static(features.velocity):
            c = data.constants[h]
            v = estimate(data.window, n, data.velocity[n], place, state.elapsed, c.period, c.quantum)
            data.velocity[n] = v
            velocity = v.velocity
        motion = data.motion[n]
        if wp.static(features.coupling):
            motion = coupled_proxy(data.motion_constants[h], motion, place, state.felt)
            place = motion.proxy
        data.motion[n] = carry(data.motion_constants[h], motion, place, holds)
        return ask(data, state, w, h, n, new, velocity)

    return render


def refreshing(features: ChainFeatures) -> wp.Function:
    """`(data, state, w, h, n) -> state`: a new state taken in; hold taken where there is none, or time began anew."""
    take_in = taking_in(features)

    @wp.func
    def refresh(data: ChainData, state: ChainState, w: int, h: int, n: int) -> ChainState:
        """The state with spheres and traps [µm] as published, or a fault where a number is none."""
        out = state
        out.beat = data.published.beat[w]
        time = data.published.time[w]
        anew = int(0)
        if state.holds == 0 or time < state.scene_time:
            anew = 1
        finite = all_finite(data.felt, data.published, data.spheres, w, h, n, anew)
        if finite:
            data.model[n] = take_in(data.felt, data.published, data.spheres, data.model[n], w, h, n, anew)
        if finite and wp.isfinite(time):
            out.scene_age = wp.float64(0.0)
            out.scene_time = time
            if anew != 0:
                out = take_hold(data, out, n)
        else:
            out = fault(data, out, n, wp.static(STATE))
        return out

    return refresh


def guarding(features: ChainFeatures) -> wp.Function:
    """`(data, state, w, h, n, allowed) -> state`: safety's word on the force that was asked; it is sent and held."""

    @wp.func
    def guard(data: ChainData, state: ChainState, w: int, h: int, n: int, allowed: int) -> ChainState:
        """The state after the force [N] that motors and energy allow went to the ports."""
        out = state
        constants = data.safety_constants[h]
        before = data.safety[n]
        age = wp.max(state.scene_age, state.device_age)
        safety = gained(constants, before, state.elapsed, age, allowed)
        asked = state.asked
        if safety.faulty != 0:
            asked = safety.held
        force = limited(constants, safety, safety.gain * asked, wp.min(state.elapsed, constants.period))
        account = data.passivity[n]
        if wp.static(features.passivity):
            falls = wp.where(wp.isinf(safety.ceiling), 0, 1)
            room = bounded(data.passivity_constants[h], account, force, falls)
            force = wp.vec3d(room[0], room[1], room[2])
            account.most = room[3]
        safety = sent(constants, safety, force, state.elapsed)
        data.safety[n] = safety
        account = send(data.passivity_constants[h], account, force)
        data.passivity[n] = account
        if before.wanted != 0 and safety.wanted == 0 and state.cause == 0:
            out.cause = wp.static(DEVICE_SILENT)
            if state.scene_age >= state.device_age:
                out.cause = wp.static(SIMULATION_SILENT)
        data.ports.force[w, h] = force
        data.ports.asked[w, h] = state.asked
        data.ports.phase[w, h] = safety.phase
        data.ports.energy[w, h] = account.energy
        return out

    return guard


def stepping(features: ChainFeatures) -> wp.Function:
    """`(data, w, h)`: one servo period of hand h of world w."""
    refresh, render, guard = refreshing(features), rendering(features), guarding(features)

    @wp.func
    def period(data: ChainData, w: int, h: int):
        """From the device's place [m] and the newest state to the force [N] and the places of the traps [µm]."""
        n = w * data.constants.shape[0] + h
        state = hear(data, data.state[n], w, h, n)
        new = int(0)
        if data.published.beat[w] != state.beat:
            new = 1
            state = refresh(data, state, w, h, n)
        allowed = int(1)
        if wp.static(features.dead_man):
            if (data.ports.buttons[w, h] & wp.static(DEAD_MAN)) == 0:
                allowed = 0
        if wp.static(features.clutch):
            if (data.ports.buttons[w, h] & wp.static(CLUTCH)) != 0:
                allowed = 0
        if not (state.scene_age < data.constants[h].disarm_after):
            # a simulation that comes back has its traps where it left them
            state.holds = 0
        state.asked = wp.vec3d()
        if state.holds != 0:
            state = render(data, state, w, h, n, allowed, new)
        if not is_finite(state.asked):
            state = fault(data, state, n, wp.static(FORCE))
            state.asked = wp.vec3d()
        state = guard(data, state, w, h, n, allowed)
        if state.holds != 0:
            commanded = data.motion[n].commanded
            if is_finite(commanded):
                for t in range(data.felt.trap_count[h]):
                    data.ports.commanded[w, data.felt.trap[h, t]] = data.spheres.anchor[n, t] + commanded
            else:
                state = fault(data, state, n, wp.static(MOTION))
        data.ports.holds[w, h] = state.holds
        data.ports.cause[w, h] = state.cause
        data.state[n] = state

    return period


@functools.lru_cache(maxsize=16)
def step_kernel(features: ChainFeatures) -> wp.Kernel:
    """The kernel of one servo period for hands of these features, over (worlds, hands given)."""
    period = stepping(features)

    @wp.kernel(enable_backward=False, module="unique", module_options={"fuse_fp": False})
    def chain_step(data: ChainData, hands: wp.array(dtype=wp.int32)):
        """One period of the hands given, of every world."""
        w, i = wp.tid()
        period(data, w, hands[i])

    return chain_step
