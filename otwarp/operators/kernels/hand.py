"""One servo period of a simulated operator: what it sees and feels, what it plans, where its hands go.

A movement is a sum of overlapping submovements of minimum jerk, one every `interval`, each from where the last one was
to end to where the path will be. Beside these, one every `interval` takes back a part of what is seen to be wrong, as
it was a visual delay ago; what earlier ones will take back and is not to be seen yet is counted, or a loop with these
delays would swing. Both are made with noise that grows with them. The arm follows the plan, whose forces it has
learned, and yields to the device's force about it. A felt force slows the clock of the planned movement, after the
response's delay; nothing else tells an operator with haptics from one without.
"""

import functools
from typing import Any

import warp as wp

from otwarp.kernels.core.random import Stream, gaussian_pair, noise_words
from otwarp.kernels.core.types import ModelData
from otwarp.operators.kernels.ahead import waits_term
from otwarp.operators.kernels.arm import deviate
from otwarp.operators.kernels.courses import minimum_jerk, path_at
from otwarp.operators.kernels.types import (
    CORRECTED,
    NOTHING,
    PLANNED,
    RESPONDS,
    AccountData,
    MindData,
    Person,
    SightData,
    TaskData,
)

_MOTOR = wp.constant(wp.uint32(Stream.OPERATOR))
_NOTHING, _RESPONDS = wp.constant(NOTHING), wp.constant(RESPONDS)
_BOTH = wp.constant(7)
"""Where the deviates that both hands share are drawn, beside those of hands, 2·hand and 2·hand + 1."""


@wp.func
def deviates(task: TaskData, person: Person, tick: int, which: int) -> wp.vec3d:
    """Three standard normal deviates of an operator at a period, by what they are for."""
    words = noise_words(task.seed, _MOTOR, wp.int64(tick), int(person.number), which)
    a = gaussian_pair(words[0], words[1])
    b = gaussian_pair(words[2], words[3])
    return wp.vec3d(wp.float64(a[0]), wp.float64(a[1]), wp.float64(b[0]))


@wp.func
def slowing(value: wp.float64, onset: wp.float64, span: wp.float64) -> wp.float64:
    """Part of the speed that is left: 1 up to the onset, 0 from onset·(1 + span) on."""
    return wp.clamp(wp.float64(1.0) - (value - onset) / (span * onset), wp.float64(0.0), wp.float64(1.0))


@wp.func
def sense(task: TaskData, person: Person, sight: SightData, mind: MindData, force: wp.array2d(dtype=wp.vec3d),
          world: int) -> wp.vec2d:  # fmt: skip
    """Remember what is seen and felt; what lag and force leave of the speed, each by what it was a delay ago [1]."""
    tick, ring = mind.tick[world], mind.lags.shape[0]
    place = tick % ring
    felt = wp.float64(0.0)
    for h in range(mind.position.shape[1]):
        mind.errors[place, world, h] = sight.error[world, h]
        if person.feels != _NOTHING:
            felt = wp.max(felt, wp.length(force[world, h]))
    if wp.abs(felt - mind.noticed[world]) > person.difference * mind.noticed[world]:
        mind.noticed[world] = felt
    mind.lags[place, world] = sight.lag[world]
    mind.forces[place, world] = mind.noticed[world]
    by_eye, by_hand = wp.float64(1.0), wp.float64(1.0)
    if tick >= person.visual_delay:
        seen = mind.lags[(tick - person.visual_delay) % ring, world]
        by_eye = slowing(seen, person.lag_threshold, person.span)
    if person.feels == _RESPONDS and tick >= person.response_delay:
        by_hand = slowing(mind.forces[(tick - person.response_delay) % ring, world], person.onset, person.span)
    return wp.vec2d(by_eye, by_hand)


@wp.func
def begin_submovement(task: TaskData, person: Person, mind: MindData, world: int, speed: wp.float64):
    """A submovement from where the last one was to end to where the path will be `lead` later, of both hands."""
    slot = mind.plans[world] % PLANNED
    mind.plans[world] = mind.plans[world] + 1
    aim = wp.max(mind.aim[world], mind.progress[world] + person.lead * speed)
    mind.aim[world] = aim
    mind.began[world, slot] = mind.clock[world]
    tick = mind.tick[world]
    shared = deviates(task, person, tick, _BOTH)
    for h in range(mind.position.shape[1]):
        mind.meant_before[world, h] = mind.meant_before[world, h] + mind.meant[world, h, slot]
        mind.made_before[world, h] = mind.made_before[world, h] + mind.made[world, h, slot]
        late = aim - wp.where(h == task.lagging, person.lag * person.pace, wp.float64(0.0))
        there, there_late = path_at(task.path, h, task.spacing, aim), path_at(task.path, h, task.spacing, late)
        mind.meant[world, h, slot] = there - mind.aimed[world, h]
        way = there_late - mind.aimed_late[world, h]
        own = deviates(task, person, tick, 2 * h)
        noise = wp.sqrt(person.common) * shared + wp.sqrt(wp.float64(1.0) - person.common) * own
        mind.made[world, h, slot] = way + person.noise * wp.length(way) * noise
        mind.aimed[world, h] = there
        mind.aimed_late[world, h] = there_late


@wp.func
def begin_correction(task: TaskData, person: Person, mind: MindData, world: int):
    """A submovement of each hand against a part of what is seen, and of what earlier ones have not yet taken back."""
    slot = mind.corrections[world] % CORRECTED
    mind.corrections[world] = mind.corrections[world] + 1
    tick = mind.tick[world]
    now = task.period * wp.float64(tick)
    seen_at = now - task.period * wp.float64(person.visual_delay)
    place = wp.max(tick - person.visual_delay, 0) % mind.lags.shape[0]
    for h in range(mind.position.shape[1]):
        mind.made_before[world, h] = mind.made_before[world, h] + mind.given[world, h, slot]
        mind.sent[world, h, slot] = wp.vec3d()
        error = wp.vec3d(mind.errors[place, world, h])
        for i in range(CORRECTED):
            unseen = wp.float64(1.0) - minimum_jerk((seen_at - mind.corrected[world, i]) / person.duration)
            error = error + unseen * mind.sent[world, h, i]
        back = wp.vec3d()
        if wp.length(error) > person.threshold:
            back = -person.correction * error
        mind.sent[world, h, slot] = back
        noise = deviates(task, person, tick, 2 * h + 1)
        mind.given[world, h, slot] = back + person.noise * wp.length(back) * noise
    mind.corrected[world, slot] = now


@wp.func
def move(task: TaskData, person: Person, mind: MindData, account: AccountData, force: wp.array2d(dtype=wp.vec3d),
         world: int):  # fmt: skip
    """Take the hands to where plan and force have them now, and count what the device's force has done to them."""
    hands = mind.position.shape[1]
    now = task.period * wp.float64(mind.tick[world])
    work = wp.float64(account.work[world])
    for h in range(hands):
        plan, wanted = wp.vec3d(mind.made_before[world, h]), wp.vec3d(mind.meant_before[world, h])
        for i in range(PLANNED):
            part = minimum_jerk((mind.clock[world] - mind.began[world, i]) / person.duration)
            plan = plan + part * mind.made[world, h, i]
            wanted = wanted + part * mind.meant[world, h, i]
        for i in range(CORRECTED):
            plan = plan + minimum_jerk((now - mind.corrected[world, i]) / person.duration) * mind.given[world, h, i]
        pull = wp.vec3d()
        if person.feels != _NOTHING:
            pull = force[world, h]
        away, velocity = deviate(person.turn, person.stiffness, pull, mind.deviation[world, h], mind.velocity[world, h])
        mind.deviation[world, h] = away
        mind.velocity[world, h] = velocity
        mind.wanted[world, h] = wanted
        place = plan + away
        work = work + wp.dot(pull, place - mind.position[world, h])
        mind.position[world, h] = place
        account.force[world] = account.force[world] + wp.length(pull) / wp.float64(hands)
        account.force_peak[world] = wp.max(account.force_peak[world], wp.length(pull))
    account.work[world] = work
    account.work_peak[world] = wp.max(account.work_peak[world], work)


@functools.lru_cache(maxsize=16)
def hand_kernel(shapes: tuple[str, ...]) -> Any:
    """Kernel over worlds, one servo period each, for scenes with moving obstacles of these shapes."""
    waits = waits_term(shapes)

    @wp.kernel(module="unique", enable_backward=False)
    def operate(
        model: ModelData, task: TaskData, people: wp.array(dtype=Person), sight: SightData, mind: MindData,
        account: AccountData, done: wp.array(dtype=wp.int32), force: wp.array2d(dtype=wp.vec3d),
        hand: wp.array2d(dtype=wp.vec3d),
    ):  # fmt: skip
        """One servo period of the operator of a world that is in motion, for the force [N] that was last sent."""
        world = wp.tid()
        if done[world] != 0:
            return
        person = people[world]
        left = sense(task, person, sight, mind, force, world)
        speed = person.pace * left[0] * mind.goes[world]
        if mind.clock[world] >= mind.next_plan[world]:
            mind.goes[world] = wp.where(waits(model, task, mind, person, world), wp.float64(0.0), wp.float64(1.0))
            speed = person.pace * left[0] * mind.goes[world]
            begin_submovement(task, person, mind, world, speed)
            mind.next_plan[world] = mind.next_plan[world] + person.interval
        if mind.tick[world] % person.correction_interval == person.correction_interval - 1:
            begin_correction(task, person, mind, world)
        if left[0] * mind.goes[world] < wp.float64(1.0):
            account.waited[world] = account.waited[world] + 1
        if left[1] < wp.float64(1.0):
            account.slowed[world] = account.slowed[world] + 1
        mind.tick[world] = mind.tick[world] + 1
        mind.clock[world] = mind.clock[world] + left[1] * task.period
        mind.progress[world] = wp.min(mind.progress[world] + speed * left[1] * task.period, task.end)
        move(task, person, mind, account, force, world)
        for h in range(mind.position.shape[1]):
            hand[world, h] = mind.position[world, h]

    return operate
