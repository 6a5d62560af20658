"""The energy that a hand is given: twin of `otwarp.haptics.chain.passivity.Passivity`."""

import warp as wp

from otwarp.haptics.chain.passivity import DEEPEST, HELD, KEPT, LONGEST, MEMORY, NEARLY, REFILL, REST, STILL


@wp.struct
class PassivityConstants:
    """Of one hand."""

    period: wp.float64  # [s]
    quantum: wp.float64  # resolution of the position [m]
    error: wp.float64  # of a difference of positions [m]
    reserve: wp.float64  # [J]
    capacity: wp.float64  # [J]
    share: wp.float64
    damping_limit: wp.float64  # [N·s/m]
    speed: wp.float64  # [m/s]
    acceleration: wp.float64  # [m/s²]
    hold: wp.float64  # [s]
    noise: wp.float64  # [m]


@wp.struct
class PassivityState:
    """Of one hand of one world."""

    hand: wp.vec3d  # where the device last said it was [m]
    met: wp.int32  # whether it has
    energy: wp.float64  # taken from the hand, net [J]
    floor: wp.float64  # what that may not fall below next [J]
    stake: wp.float64  # [J]
    force: wp.vec3d  # held now [N]
    age: wp.float64  # of the device's last word [s]
    anchor: wp.vec3d  # where the velocity was last measured [m]
    velocity: wp.vec3d  # [m/s]
    span: wp.float64  # over which it was measured [s]
    since: wp.float64  # time since then [s]
    jerky: wp.float64  # for which the hand is still expected to be so [s]
    clock: wp.float64  # of the block of `MEMORY` seconds [s]
    past: wp.float64  # longest silence of the last block [s]
    recent: wp.float64  # and of this one [s]
    longest: wp.float64  # hold that is expected [s]
    impulse: wp.vec3d  # of the force since the last word [N·s]
    changed: wp.float64  # by how much the force changed since then [N]
    most: wp.float64  # work that there was room for [J]
    stood: wp.vec3d  # where the hand's way was last counted [m]
    way: wp.float64  # in this block [m]
    gap: wp.float64  # longest time between two cycles since the last word [s]


@wp.func
def unspent(constants: PassivityConstants) -> PassivityState:
    """Nothing taken or given yet [J]."""
    out = PassivityState()
    out.span = constants.period
    out.floor = -constants.reserve
    out.stake = constants.reserve
    out.longest = wp.max(constants.period, constants.hold)
    return out


@wp.func
def detour(constants: PassivityConstants, state: PassivityState, time: wp.float64) -> wp.float64:
    """Farthest that a hand strays from the straight line between two places that it is `time` [s] apart [m]."""
    way = wp.float64(0.5) * constants.speed * time
    if state.jerky <= wp.float64(0.0):
        way = wp.min(way, wp.float64(0.125) * constants.acceleration * time * time)
    return way


@wp.func
def pay(constants: PassivityConstants, state: PassivityState, work: wp.float64) -> PassivityState:
    """Give `work` [J] away; the floor is what energy may not fall below next."""
    out = state
    zero = wp.float64(0.0)
    energy = state.energy - work
    if not (wp.static(wp.float64(-DEEPEST)) <= energy and energy <= constants.capacity):
        energy = wp.where(energy > zero, constants.capacity, wp.static(wp.float64(-DEEPEST)))
    out.energy = energy
    if energy < state.floor:
        out.stake = wp.float64(0.5) * state.stake
        out.floor = energy - out.stake
        out.way = wp.float64(wp.inf)
    elif energy >= zero:
        out.stake = constants.reserve
        out.floor = -constants.reserve
    elif energy - state.stake > state.floor:
        out.floor = energy - state.stake
    return out


@wp.func
def remember(constants: PassivityConstants, state: PassivityState, silence: wp.float64) -> PassivityState:
    """Longest silence [s], and whether the hand rested, in this block of `MEMORY` seconds and in the last."""
    out = state
    zero = wp.float64(0.0)
    if state.clock >= wp.static(wp.float64(MEMORY)):
        if state.way <= wp.static(wp.float64(REST)) * state.clock:
            # a debt is forgiven, the reserve fills up; what is in store stays
            back = wp.float64(wp.inf)
            if state.floor >= -constants.reserve:
                back = wp.static(wp.float64(REFILL)) * state.clock
            out.energy = wp.max(state.energy, wp.min(zero, state.energy + back))
            out.floor = -constants.reserve
            out.stake = constants.reserve
        out.past = state.recent
        out.clock = zero
        out.recent = zero
        out.way = zero
    out.recent = wp.max(out.recent, wp.min(silence, wp.static(wp.float64(LONGEST))))
    out.longest = wp.max(wp.max(constants.period, constants.hold), wp.max(out.past, out.recent))
    return out


@wp.func
def measure(constants: PassivityConstants, state: PassivityState, place: wp.vec3d) -> PassivityState:
    """Velocity [m/s] over the time that really passed, and whether it changed more than was foreseen."""
    out = state
    one = wp.float64(1.0)
    span = state.since
    velocity = (place - state.anchor) / span
    change = wp.float64(0.5) * constants.acceleration * (state.span + span)
    change = change + constants.error * (one / state.span + one / span)
    turn = velocity - state.velocity
    if not (wp.dot(turn, turn) <= change * change):
        out.jerky = wp.static(wp.float64(MEMORY))
    out.anchor = place
    out.velocity = velocity
    out.span = span
    out.since = wp.float64(0.0)
    return out


@wp.func
def count(constants: PassivityConstants, state: PassivityState, place: wp.vec3d, age: wp.float64) -> PassivityState:
    """Work, way and velocity from the last position to this one [m], which is `age` [s] later."""
    out = state
    zero = wp.float64(0.0)
    hidden = wp.float64(0.0)
    force = state.force
    if state.changed != zero:
        # meanwhile: its mean, and what a detour may have hidden
        force = state.impulse / age
        hidden = state.changed * detour(constants, state, wp.min(age, state.longest))
        out.changed = zero
    out.impulse = wp.vec3d()
    work = wp.dot(force, place - state.hand)
    if work < zero and (age > wp.static(wp.float64(LONGEST)) or state.gap > wp.static(wp.float64(HELD))):
        # what may have fallen meanwhile has not surely won anything
        work = zero
    out.gap = zero
    out.hand = place
    # together no more than there was room for
    out = pay(constants, out, wp.max(work, wp.min(work + hidden, state.most)))
    way = wp.length(place - state.stood)
    if way > constants.error:
        out.stood = place
        out.way = out.way + way
    if state.since >= wp.float64(0.5) * constants.period:
        out = measure(constants, out, place)
    return out


@wp.func
def observe(
    constants: PassivityConstants, state: PassivityState, place: wp.vec3d, elapsed: wp.float64, known: wp.int32
) -> PassivityState:
    """Count the work [J] of the force held in the last `elapsed` [s]; `known` if the device said its place [m] now."""
    out = state
    age = state.age + elapsed
    out.age = age
    out.since = state.since + elapsed
    out.gap = wp.max(state.gap, elapsed)
    out.jerky = state.jerky - elapsed
    out.clock = state.clock + elapsed
    if state.changed != wp.float64(0.0) or known == 0:
        out.impulse = state.impulse + state.force * elapsed
    if known != 0:
        out.age = wp.float64(0.0)
        if state.met == 0:
            out.met = 1
            out.hand = place
            out.anchor = place
            out.stood = place
        else:
            out = count(constants, out, place, age)
        if out.clock >= wp.static(wp.float64(MEMORY)) or age > out.recent:
            out = remember(constants, out, age)
    return out


@wp.func
def controlled(
    constants: PassivityConstants, state: PassivityState, force: wp.vec3d, velocity: wp.vec3d
) -> wp.vec3d:  # fmt: skip
    """The force [N] asked for, less what would give more than a share of the energy at hand at this velocity [m/s]."""
    zero = wp.float64(0.0)
    out = force
    work = wp.dot(force, velocity)
    left = state.energy + wp.static(wp.float64(KEPT)) * constants.reserve
    if not (work <= zero and zero <= left):
        speed = wp.length(velocity)
        way = state.longest * speed
        if way >= wp.static(wp.float64(STILL)):
            along = work / speed
            given = wp.float64(0.0)
            if left > zero:
                # an encoder says nothing for a while, and then a whole step
                given = constants.share * left / (way + constants.quantum)
            less = wp.max(along - given, zero)
            if left < zero:
                # what the force takes by itself counts towards winning back
                missing = wp.min(along, zero) - left / way
                less = less + wp.min(wp.max(missing, zero), constants.damping_limit * speed)
            out = force - (less / speed) * velocity
    return out


@wp.func
def hidden_work(constants: PassivityConstants, state: PassivityState, force: wp.vec3d) -> wp.float64:
    """Work [J] that an error of the position can hide when the force [N] changes to this."""
    return constants.noise * wp.length(force - state.force)


@wp.func
def needed(
    constants: PassivityConstants, state: PassivityState, force: wp.vec3d, size: wp.float64, ends: wp.float64
) -> wp.float64:
    """Most work [J] that a hand can take from a force [N] of this size in the hold that is expected."""
    t = state.longest
    reach = t * constants.speed
    if state.jerky <= wp.float64(0.0) and state.floor >= -constants.reserve:
        along = wp.dot(force, state.velocity) / size
        end = t * (along + constants.acceleration * (wp.float64(0.5) * (state.span + t) + state.since))
        reach = wp.min(reach, wp.max(end, wp.float64(0.0)) + constants.error * t / state.span)
    return size * (reach + ends)


@wp.func
def room_for(constants: PassivityConstants, state: PassivityState, force: wp.vec3d) -> wp.vec2d:
    """Factor that makes a force [N] so small that no motion within reach takes more than there is; work it may do [J].

    For a force that is not zero, with the device's place known.
    """
    zero = wp.float64(0.0)
    size = wp.length(force)
    room = wp.static(wp.float64(NEARLY)) * (state.energy - state.floor - hidden_work(constants, state, force))
    # the force's own end costs noise once more, and again when it is taken away
    ends = constants.error + wp.float64(2.0) * constants.noise
    need = size * (state.longest * constants.speed + ends)
    if need > room:
        need = needed(constants, state, force, size, ends)
    k = wp.float64(1.0)
    if need > room:
        k = wp.float64(0.0)
        if room > zero:
            k = room / need
    return wp.vec2d(k, k * need)


@wp.func
def bounded(constants: PassivityConstants, state: PassivityState, force: wp.vec3d, falls: wp.int32) -> wp.vec4d:
    """The bounded force [N], and behind it the work that there is room for [J].

    Between two words of the device the force stays what it was; one that must fall falls, without a turn.
    """
    one = wp.float64(1.0)
    out = force
    most = state.most
    size = wp.length(force)
    if state.age > wp.float64(0.0):
        out = state.force
        held = wp.length(state.force)
        if falls != 0 and size < held:
            out = (size / held) * state.force
    else:
        most = wp.float64(0.0)
        if size != wp.float64(0.0):
            k = room_for(constants, state, force)
            most = k[1]
            if k[0] != one:
                out = k[0] * force
    return wp.vec4d(out[0], out[1], out[2], most)


@wp.func
def send(constants: PassivityConstants, state: PassivityState, force: wp.vec3d) -> PassivityState:
    """The account with `force` [N] held from now on."""
    out = state
    change = wp.length(force - state.force)
    if change != wp.float64(0.0):
        if state.age > wp.float64(0.0):
            out.changed = state.changed + change
        out = pay(constants, out, constants.noise * change)
        out.force = force
    return out
