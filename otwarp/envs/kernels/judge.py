"""One kernel for a task: what is observed of a world, what it earns, and whether its episode is over."""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from otwarp.envs.kernels.starts import StartData, start_anew
from otwarp.envs.kernels.types import EpisodeData, PlaceData, TaskNow
from otwarp.kernels.core.features import CPU_FLAGS
from otwarp.kernels.core.functions import compiled, function_from_text
from otwarp.kernels.core.rounding import PRECISION
from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData, WorldsData
from otwarp.kernels.drivers.episodes import WorldFunction, parameters_from
from otwarp.kernels.drivers.lane_groups import from_start

LIMIT = wp.constant(10.0)
"""Scaled observations lie within ± so much."""
HELD = wp.constant(1 << 20)
"""Code of a world that has been reset and waits for the end of the period."""
CUT_OFF = wp.constant(1 << 19)
"""Code of a world whose time is over."""


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


def seen_term(readings: tuple[Reading, ...]) -> wp.Function:
    """`(now, values, scale, seen)`: write all observed numbers of a world; `values` (1, P), `scale` (1, O).

    All are found before any is written: for the compiler, what is written could change what is still to be read.
    """
    names, lines, stores = _names(), [], []
    for n, reading in enumerate(readings):
        # each kind of result is asked for by itself, so that a wrong one is told by its name
        kinds, allowed = ((wp.vec3,), "wp.vec3") if reading.components else ((wp.float32,), "float")
        names[f"seen_{n}"] = compiled(reading.function.function, PRECISION, "observation", kinds, allowed)
        first = sum(r.function.width for r in readings[:n])
        lines.append(f"    found_{n} = seen_{n}(now{parameters_from(reading.function, first)})")
        for component in reading.components or (None,):
            value, column = f"found_{n}" if component is None else f"found_{n}[{component}]", len(stores)
            lines.append(f"    value_{column} = wp.clamp({value} / scale[0, {column}], -LIMIT, LIMIT)")
            stores.append(f"    seen[now.world, {column}] = value_{column}")
    text = (
        "def see(now: TaskNow, values: Values, scale: Values, seen: Values):\n"
        '    """Write all observed numbers of a world."""\n    row = 0\n' + "\n".join([*lines, *stores]) + "\n"
    )
    return wp.func(function_from_text("see", text, names))


def earned_term(rewards: tuple[WorldFunction, ...]) -> wp.Function:
    """`(now, values, weight, earned) -> float`: write each weighted reward of a world; their sum."""
    names = _names()
    calls = _called(rewards, "reward", (wp.float32,), "float", names)
    lines = [f"    part_{n} = weight[0, {n}] * {call}\n" for n, call in enumerate(calls)]
    lines += [f"    earned[now.world, {n}] = part_{n}\n    total = total + part_{n}\n" for n in range(len(calls))]
    text = (
        "def earn(now: TaskNow, values: Values, weight: Values, earned: Values) -> float:\n"
        '    """Write each weighted reward of a world; their sum."""\n    row = 0\n    total = float(0.0)\n'
        + "".join(lines) + "    return total\n"
    )  # fmt: skip
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


def judge_period_term(rewards: tuple[WorldFunction, ...], ends: tuple[WorldFunction, ...]) -> wp.Function:
    """`(now, worlds, numbers, out)`: rewards of a period, and whether the episode is over."""
    earn, ended = earned_term(rewards), ended_term(ends)

    @wp.func
    def judge_period(now: TaskNow, worlds: WorldsData, numbers: NumberData, out: VerdictData):
        """Write what the period of a world has earned, its outcome, and why its episode ends, if it does."""
        out.reward[now.world] = earn(now, numbers.earned, numbers.weight, out.earned)
        code = ended(now, numbers.ended)
        if code > 0:
            out.success[now.world] = numbers.success[0, code - 1] != 0
        if worlds.done[now.world] < 0:
            code = -1
            out.success[now.world] = False
        out.outcome[now.world] = code
        out.terminated[now.world] = code != 0
        worlds.done[now.world] = code
        if code == 0 and now.time >= now.place.time_limit - 0.5 * now.place.period:
            out.truncated[now.world] = True
            worlds.done[now.world] = CUT_OFF

    return judge_period


def judge_world_term(
    rewards: tuple[WorldFunction, ...], ends: tuple[WorldFunction, ...], see: wp.Function
) -> wp.Function:
    """`(control, state, readout, place, worlds, numbers, keep_last, episode, out, world)` after a period."""
    judge_period = judge_period_term(rewards, ends)

    @wp.func
    def judge_world(control: ControlData, state: StateData, readout: ReadoutData, place: PlaceData,
                    worlds: WorldsData, numbers: NumberData, keep_last: int, episode: EpisodeData, out: VerdictData,
                    world: int):  # fmt: skip
        """Judge the period of a world; one that has just been reset is only observed."""
        for t in range(control.trap_velocity.shape[1]):
            control.trap_position[world, t] = episode.focus[world, t]
            control.trap_velocity[world, t] = wp.vec3(0.0)
        for b in range(episode.gap.shape[1]):
            episode.gap[world, b] = wp.nan
        period = episode.period[world]
        fresh = period == 0
        out.terminated[world] = False
        out.truncated[world] = False
        out.outcome[world] = 0
        out.success[world] = False
        if episode.held[world] != 0:
            if episode.held[world] == 1:
                worlds.done[world] = 0
            episode.held[world] = 0
            out.reward[world] = 0.0
            for n in range(out.earned.shape[1]):
                out.earned[world, n] = 0.0
        else:
            period = period + 1
            episode.period[world] = period
            for t in range(episode.power.shape[1]):
                episode.energy[world] = episode.energy[world] + episode.power[world, t] * place.period
            now = TaskNow(world, period, float(period) * place.period, state, readout, place, episode)
            judge_period(now, worlds, numbers, out)
        now = TaskNow(world, period, float(period) * place.period, state, readout, place, episode)
        see(now, numbers.seen, numbers.scale, out.seen)
        # of a world in between nothing changes: what its last episode had seen was cleared in its first period
        if keep_last != 0 and (fresh or worlds.done[world] != 0):
            for n in range(out.seen.shape[1]):
                out.last_seen[world, n] = wp.where(worlds.done[world] != 0, out.seen[world, n], 0.0)

    return judge_world


def start_world_term(see: wp.Function) -> wp.Function:
    """`(start, model, control, state, readout, place, worlds, numbers, hold, episode, seen, world)`: its next one."""

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
            see(TaskNow(world, 0, 0.0, state, readout, place, episode), numbers.seen, numbers.scale, seen)

    return start_world


@functools.lru_cache(maxsize=64)
def judge_kernels(
    readings: tuple[Reading, ...], rewards: tuple[WorldFunction, ...], ends: tuple[WorldFunction, ...]
) -> tuple[wp.Kernel, wp.Kernel]:
    """Kernel that judges a period of each world, and one that starts worlds anew."""
    see = seen_term(readings)
    judge_world, start_world = judge_world_term(rewards, ends, see), start_world_term(see)

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def judge(control: ControlData, state: StateData, readout: ReadoutData, place: PlaceData, worlds: WorldsData,
              numbers: NumberData, keep_last: int, episode: EpisodeData, out: VerdictData, each: int):  # fmt: skip
        """After a period: traps at rest where they have come to, rewards, ends and observations."""
        first = wp.tid() * each
        for w in range(first, wp.min(first + each, worlds.done.shape[0])):
            judge_world(control, state, readout, place, worlds, numbers, keep_last, episode, out, from_start(w))

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def start_worlds(start: StartData, model: ModelData, control: ControlData, state: StateData, readout: ReadoutData,
                     place: PlaceData, worlds: WorldsData, numbers: NumberData, ended: int, hold: int,
                     episode: EpisodeData, seen: wp.array2d(dtype=wp.float32), each: int):  # fmt: skip
        """Start the flagged worlds anew, or with `ended` those whose episodes are over; observe those not on hold."""
        first = wp.tid() * each
        for w in range(first, wp.min(first + each, worlds.done.shape[0])):
            chosen = episode.flags[w] != 0
            if ended != 0:
                chosen = worlds.done[w] != 0
            if chosen:
                start_world(start, model, control, state, readout, place, worlds, numbers, hold, episode, seen,
                            from_start(w))  # fmt: skip

    return judge, start_worlds
