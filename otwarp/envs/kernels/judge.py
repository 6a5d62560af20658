"""One kernel for a task: what is observed of a world, what it earns, and whether its episode is over."""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from otwarp.envs.kernels.geometry import find_gaps
from otwarp.envs.kernels.rows import row_type, store_row_term
from otwarp.envs.kernels.specialise import called_for
from otwarp.envs.kernels.starts import StartData, start_anew
from otwarp.envs.kernels.types import EpisodeData, PlaceData, TaskNow
from otwarp.kernels.core.features import CPU_FLAGS
from otwarp.kernels.core.functions import compiled, function_from_text
from otwarp.kernels.core.rounding import PRECISION
from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData, WorldsData
from otwarp.kernels.drivers.episodes import WorldFunction, end_code, parameters_from, turn_clock
from otwarp.kernels.drivers.lane_groups import from_start

LIMIT = wp.constant(10.0)
"""Scaled observations lie within ± so much."""
HELD = wp.constant(1 << 20)
"""Code of a world that has been reset and waits for the end of the period."""
CUT_OFF = wp.constant(1 << 19)
"""Code of a world whose time is over."""

BLOCK = 64
"""Threads of a block on a GPU."""
JUDGE_BLOCKS, START_BLOCKS = 12, 8
"""Blocks that a multiprocessor is to hold: 80 and 128 registers a thread."""


@wp.struct
class VerdictData:
    """What a period led to; R rewards, O observed numbers."""

    seen: wp.array2d(dtype=wp.float32)  # (W, O) scaled
    earned: wp.array2d(dtype=wp.float32)  # (W, R) each weighted reward
    reward: wp.array(dtype=wp.float32)  # (W) their sum
    terminated: wp.array(dtype=wp.bool)  # (W)
    truncated: wp.array(dtype=wp.bool)  # (W)
    outcome: wp.array(dtype=wp.int32)  # (W) n for the n-th end, counted from 1, -1 for a fault, 0 for none
    success: wp.array(dtype=wp.bool)  # (W)
    last_seen: wp.array2d(dtype=wp.float32)  # (W, O) where an episode has ended in this period, else 0


@dataclass(frozen=True)
class Reading:
    """Numbers that are observed: a function, and which components of its vector count; () for a number."""

    function: WorldFunction
    components: tuple[int, ...]


def _called(functions: tuple[WorldFunction, ...], name: str, returns: tuple[Any, ...], allowed: str, names: dict):
    """Calls of functions by texts, each with its numbers from a row of `values`."""
    calls, first = [], 0
    for n, function in enumerate(functions):
        names[f"{name}_{n}"] = compiled(function.function, PRECISION, name, returns, allowed)
        calls.append(f"{name}_{n}(now{parameters_from(function, first)})")
        first += function.width
    return calls


def _names() -> dict[str, Any]:
    return {"TaskNow": TaskNow, "Values": wp.array2d(dtype=wp.float32), "vec3": wp.vec3, "wp": wp, "LIMIT": LIMIT}


def columns_of(readings: tuple[Reading, ...]) -> int:
    """Numbers that are observed."""
    return sum(len(reading.components) or 1 for reading in readings)


def seen_term(readings: tuple[Reading, ...]) -> wp.Function:
    """`(now, values, scale) -> row`: all observed numbers of a world; `values` (1, P), `scale` (1, O)."""
    names, lines, column = _names(), [], 0
    names["Row"] = row_type(columns_of(readings))
    for n, reading in enumerate(readings):
        # each kind of result is asked for by itself, so that a wrong one is told by its name
        kinds, allowed = ((wp.vec3,), "wp.vec3") if reading.components else ((wp.float32,), "float")
        names[f"seen_{n}"] = compiled(reading.function.function, PRECISION, "observation", kinds, allowed)
        first = sum(r.function.width for r in readings[:n])
        lines.append(f"    found_{n} = seen_{n}(now{parameters_from(reading.function, first)})")
        for component in reading.components or (None,):
            value = f"found_{n}" if component is None else f"found_{n}[{component}]"
            lines.append(f"    seen[{column}] = wp.clamp({value} / scale[0, {column}], -LIMIT, LIMIT)")
            column += 1
    text = (
        "def see(now: TaskNow, values: Values, scale: Values) -> Row:\n"
        '    """All observed numbers of a world."""\n    row = 0\n    seen = Row()\n'
        + "".join(f"{line}\n" for line in lines) + "    return seen\n"
    )  # fmt: skip
    return wp.func(function_from_text("see", text, names))


def earned_term(rewards: tuple[WorldFunction, ...]) -> wp.Function:
    """`(now, values, weight) -> (float, row)`: sum of the weighted rewards of a world, and each of them."""
    names = _names()
    names["Row"] = row_type(len(rewards))
    calls = _called(rewards, "reward", (wp.float32,), "float", names)
    lines = [f"    part_{n} = weight[0, {n}] * {call}\n" for n, call in enumerate(calls)]
    lines += [f"    earned[{n}] = part_{n}\n    total = total + part_{n}\n" for n in range(len(calls))]
    text = (
        "def earn(now: TaskNow, values: Values, weight: Values):\n"
        '    """Sum of the weighted rewards of a world, and each."""\n    row = 0\n    total = float(0.0)\n'
        "    earned = Row()\n" + "".join(lines) + "    return total, earned\n"
    )
    return wp.func(function_from_text("earn", text, names))


def ended_term(ends: tuple[WorldFunction, ...]) -> wp.Function:
    """`(now, values) -> code`: 1 + the place of the first end that says so, 0 while none does."""
    names = _names()
    calls = _called(ends, "end", (wp.bool, wp.int32), "bool", names)
    lines = [f"    if {call}:\n        code = {n + 1}\n" for n, call in reversed(list(enumerate(calls)))]
    text = (
        "def ended(now: TaskNow, values: Values) -> int:\n"
        '    """Code of the first end that a world has come to."""\n    row = 0\n    code = int(0)\n'
        + "".join(lines) + "    return code\n"
    )  # fmt: skip
    return wp.func(function_from_text("ended", text, names))


@wp.struct
class NumberData:
    """Numbers of the terms, a row each."""

    seen: wp.array2d(dtype=wp.float32)  # parameters of observations
    scale: wp.array2d(dtype=wp.float32)
    earned: wp.array2d(dtype=wp.float32)  # parameters of rewards
    weight: wp.array2d(dtype=wp.float32)
    ended: wp.array2d(dtype=wp.float32)  # parameters of ends
    success: wp.array2d(dtype=wp.int32)  # (1, E) whether an end is one that was wanted


@dataclass(frozen=True)
class TaskTerms:
    """What the terms of a task are compiled to.

    Attributes:
        see: As `seen_term` makes it.
        earn: As `earned_term` makes it.
        ended: As `ended_term` makes it.
        find_gaps: For the shapes of the scene's obstacles.
        gaps_seen: Whether a gap is observed.
        observed: Numbers that are observed.
        rewarded: Rewards.
    """

    see: wp.Function
    earn: wp.Function
    ended: wp.Function
    find_gaps: wp.Function
    gaps_seen: bool
    observed: int
    rewarded: int


@wp.struct
class Outcome:
    """What a world has come to in a period."""

    code: wp.int32  # of its end, -1 for a fault, 0 for none
    success: wp.bool
    truncated: wp.bool
    done: wp.int32  # not 0 where the episode is over


@wp.func
def spend(episode: EpisodeData, place: PlaceData, world: int):
    """Add the energy of all traps in a period."""
    energy = episode.energy[world]
    for t in range(episode.power.shape[1]):
        energy = energy + episode.power[world, t] * place.period
    episode.energy[world] = energy


@wp.func
def stop_traps(control: ControlData, episode: EpisodeData, world: int):
    """Traps at rest where they have come to."""
    for t in range(control.trap_velocity.shape[1]):
        control.trap_position[world, t] = episode.focus[world, t]
        control.trap_velocity[world, t] = wp.vec3(0.0)


@wp.func
def write_outcome(worlds: WorldsData, episode: EpisodeData, out: VerdictData, found: Outcome, world: int):
    """Write what a world has come to, and list one whose episode is over."""
    out.terminated[world] = found.code != 0
    out.truncated[world] = found.truncated
    out.outcome[world] = found.code
    out.success[world] = found.success
    episode.held[world] = 0
    worlds.done[world] = found.done
    if found.done != 0:
        episode.over[wp.atomic_add(episode.over_count, 0, 1)] = world


def outcome_term(ended: wp.Function) -> wp.Function:
    """`(now, done, numbers) -> Outcome` of a period, `done` as its steps have left it."""

    @wp.func
    def outcome_of(now: TaskNow, done: int, numbers: NumberData) -> Outcome:
        """Whether the episode is over, and why."""
        found = Outcome()
        code = ended(now, numbers.ended)
        if done < 0:
            code = -1
        if code > 0:
            found.success = numbers.success[0, code - 1] != 0
        found.code = code
        found.done = code
        if code == 0 and now.time >= now.place.time_limit - 0.5 * now.place.period:
            found.truncated = True
            found.done = CUT_OFF
        return found

    return outcome_of


def judge_world_term(terms: TaskTerms) -> wp.Function:
    """`(control, state, readout, place, worlds, numbers, steps, keep_last, episode, out, world)` after a period."""
    outcome_of, see, earn, find_gaps = outcome_term(terms.ended), terms.see, terms.earn, terms.find_gaps
    store_seen, store_earned = store_row_term(terms.observed), store_row_term(terms.rewarded)
    seen_row, earned_row = row_type(terms.observed), row_type(terms.rewarded)

    @wp.func
    def judge_world(control: ControlData, state: StateData, readout: ReadoutData, place: PlaceData,
                    worlds: WorldsData, numbers: NumberData, steps: int, keep_last: int, episode: EpisodeData,
                    out: VerdictData, world: int):  # fmt: skip
        """Judge the period of a world, of `steps` steps; one that has just been reset is only observed.

        What terms read is written before them, and what they have found after all of them: for the compiler, what is
        written could change what is still to be read.
        """
        held = episode.held[world]
        done = worlds.done[world]
        if done == 0:
            turn_clock(worlds, world, steps)
            done = end_code(readout, world, 0)
        last = episode.period[world]
        period = last
        if held == 0:
            period = last + 1
            spend(episode, place, world)
        now = TaskNow(world, period, float(period) * place.period, state, readout, place, episode)
        find_gaps(now)
        found = Outcome()
        reward = float(0.0)
        earned = earned_row()
        if held == 0:
            reward, earned = earn(now, numbers.earned, numbers.weight)
            found = outcome_of(now, done, numbers)
            # learners add rewards up: one that is no number would be in all that they learn
            if found.code < 0 and not wp.isfinite(reward):
                reward = float(0.0)
                earned = earned_row()
        elif held != 1:
            found.done = done
        seen = see(now, numbers.seen, numbers.scale)
        episode.period[world] = period
        out.reward[world] = reward
        store_earned(out.earned, world, earned)
        store_seen(out.seen, world, seen)
        # of a world in between nothing changes: what its last episode had seen was cleared in its first period
        if keep_last != 0 and (last == 0 or found.done != 0):
            store_seen(out.last_seen, world, wp.where(found.done != 0, seen, seen_row()))
        stop_traps(control, episode, world)
        write_outcome(worlds, episode, out, found, world)

    return judge_world


def start_world_term(terms: TaskTerms) -> wp.Function:
    """`(start, model, control, state, readout, place, worlds, numbers, hold, episode, seen, world)`: its next one."""
    see, store_seen, find_gaps = terms.see, store_row_term(terms.observed), terms.find_gaps
    gaps_seen = terms.gaps_seen

    @wp.func
    def start_world(start: StartData, model: ModelData, control: ControlData, state: StateData, readout: ReadoutData,
                    place: PlaceData, worlds: WorldsData, numbers: NumberData, hold: int, episode: EpisodeData,
                    seen: wp.array2d(dtype=wp.float32), world: int):  # fmt: skip
        """Start a world anew, and observe it; with `hold` it waits for the end of the period, which observes it."""
        start_anew(start, model, control, state, readout, world, episode)
        if hold != 0:
            episode.held[world] = 1
            worlds.done[world] = HELD
        else:
            now = TaskNow(world, 0, 0.0, state, readout, place, episode)
            if wp.static(gaps_seen):
                find_gaps(now)
            store_seen(seen, world, see(now, numbers.seen, numbers.scale))

    return start_world


def _kernel_of(blocks: int) -> Any:
    """Decorator of a kernel of which a GPU's multiprocessor is to hold so many blocks."""
    options = {"cpu_compiler_flags": CPU_FLAGS, "block_dim": BLOCK}
    how = {"grid_stride": False, "launch_bounds": (BLOCK, blocks), "module_options": options}
    return wp.kernel(module="unique", enable_backward=False, **how)


@functools.lru_cache(maxsize=64)
def judge_kernels(
    readings: tuple[Reading, ...],
    rewards: tuple[WorldFunction, ...],
    ends: tuple[WorldFunction, ...],
    shapes: tuple[str, ...],
    gaps_seen: bool,
) -> tuple[wp.Kernel, wp.Kernel]:
    """Kernel that judges a period of each world, and one that starts worlds of a list anew.

    `shapes` are those of the obstacles, for which the terms are made, too; `gaps_seen`: a gap is observed.
    """
    terms = TaskTerms(
        see=seen_term(readings),
        earn=earned_term(rewards),
        ended=ended_term(ends),
        find_gaps=called_for(find_gaps, shapes),
        gaps_seen=gaps_seen,
        observed=columns_of(readings),
        rewarded=len(rewards),
    )
    judge_world, start_world = judge_world_term(terms), start_world_term(terms)

    @_kernel_of(JUDGE_BLOCKS)
    def judge(control: ControlData, state: StateData, readout: ReadoutData, place: PlaceData, worlds: WorldsData,
              numbers: NumberData, steps: int, keep_last: int, episode: EpisodeData, out: VerdictData,
              each: int):  # fmt: skip
        """After the steps of a period: clocks, traps at rest where they have come to, rewards, ends, observations."""
        first = wp.tid() * each
        for w in range(first, wp.min(first + each, worlds.done.shape[0])):
            world = from_start(w)
            judge_world(control, state, readout, place, worlds, numbers, steps, keep_last, episode, out, world)

    @_kernel_of(START_BLOCKS)
    def start_worlds(start: StartData, model: ModelData, control: ControlData, state: StateData, readout: ReadoutData,
                     place: PlaceData, worlds: WorldsData, numbers: NumberData, listed: wp.array(dtype=wp.int32),
                     count: wp.array(dtype=wp.int32), ended: int, hold: int, episode: EpisodeData,
                     seen: wp.array2d(dtype=wp.float32), each: int):  # fmt: skip
        """Start the first `count` of the listed worlds anew, with `ended` those whose episodes are over; observe those
        not on hold. `each` places of the list a thread."""
        first = wp.tid() * each
        for place_in_list in range(first, wp.min(first + each, count[0])):
            world = from_start(listed[place_in_list])
            # a world that has ended may have been started anew since, by itself
            if ended == 0 or worlds.done[world] != 0:
                start_world(start, model, control, state, readout, place, worlds, numbers, hold, episode, seen, world)

    return judge, start_worlds
