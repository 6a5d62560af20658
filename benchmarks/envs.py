"""Environments: steps a second of one, some and many, what they add to bare steps, and beside published rates."""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from benchmarks.report import Section, command, positive
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Pairs, Quartiles, calls_for, elapsed, interleaved
from otwarp.device import pick_device
from otwarp.envs.batch import Batch
from otwarp.envs.registration import TASKS, task_of
from otwarp.envs.vector import VectorEnv
from otwarp.errors import InputError, SimulationError
from otwarp.simulation.simulation import Simulation

WORLDS = (1, 64, 4_096, 65_536)
"""Environments that are timed."""
SLOW = {("otwarp/CellDelivery-v0", "cpu"): 4_096}
"""Most of them where more would take too long: a step of 65,536 takes a core some 20 s."""
MEASURED = ("otwarp/Navigate-v0", "otwarp/CellDelivery-v0")
"""Tasks that are timed, as far as they are shipped."""
PUBLISHED = {
    "OT-Gym, the paper's companion: control at 5 Hz, in real time": 5.0,
    "mujoco_warp, humanoid, 8,192 worlds on one large GPU": 4.0e6,
}
"""Steps a second that others state, of other tasks on other machines."""
ARRAYS = tuple(arrays for arrays in ("numpy", "torch") if importlib.util.find_spec(arrays))
"""Kinds of arrays with which users call steps; torch where it is installed."""
STILL = 0.05
"""Largest share of bare worlds that may stand still after a fault: then they cost less, and a ratio says nothing."""


def acting(batch: Batch) -> None:
    """Let a batch begin, under actions that differ from world to world and stay."""
    batch.restart(seeds=np.arange(batch.worlds))
    draws = np.random.default_rng(1).uniform(-0.3, 0.3, batch.actions.shape)
    batch.actions.assign(draws.astype(np.float32))


def per_step(work: Callable[[], object], device: wp.Device, seconds: float) -> Callable[[], float]:
    """A measurement of the wall time of one call [s], of as many as take `seconds`."""

    def repeated(calls: int) -> None:
        for _ in range(calls):
            work()

    calls = calls_for(repeated, device, seconds)
    return lambda: elapsed(partial(repeated, calls), device).wall / calls


def velocities(batch: Batch) -> np.ndarray:
    """(W, T, 3) of the traps of environments by their actions, in the period that is to come [µm/s]."""
    axis, actions = batch.layout.axis, np.clip(batch.actions.numpy(), -1.0, 1.0)
    share = np.where(axis >= 0, actions[:, axis], 0.0)
    return batch.task.speed_limit * share / np.maximum(np.linalg.norm(share, axis=2, keepdims=True), 1.0)


def bare_worlds(batch: Batch, **ends: Any) -> Simulation:
    """As many worlds of the same scene, whose traps glide as those of environments do."""
    sim = Simulation(
        batch.scene, worlds=batch.worlds, device=batch.device, time_step=batch.sim.time_step, threads=1,
        glides=batch.layout.moves, **ends,
    )  # fmt: skip
    commands = batch.sim.control
    # from here on each world has commands of its own, and none that the scene gives
    sim.control.set(trap_position=commands.trap_position.numpy(), trap_power=commands.trap_power.numpy())
    return sim


def alike(sim: Simulation, batch: Batch) -> None:
    """Put bare worlds where environments are at the start of a period, their traps on the way that actions will take.

    Other states cost other times. Worlds that may end have the clocks of the environments, others have one clock.
    """
    for array in (sim.last_readout.fault, sim.last_readout.fault_count):
        array.zero_()
    for name in ("position", "orientation", "trap_position"):
        if getattr(sim.state, name).size:
            getattr(sim.state, name).assign(getattr(batch.sim.state, name))
    control, steps = sim.control, np.full(batch.worlds, sim.state.step)
    if sim.options.ends is not None:
        sim.episodes.done.zero_()
        sim.episodes.step.assign(batch.sim.episodes.step)
        steps = sim.episodes.step.numpy()
    for name in ("trap_position", "trap_power"):
        getattr(control, name).assign(getattr(batch.sim.control, name))
    if batch.layout.moves:
        control.trap_velocity.assign(velocities(batch).astype(np.float32))
        control.trap_since.assign(steps * sim.time_step)


def go_on(sim: Simulation, steps: int) -> None:
    """Step bare worlds; one that is driven too hard, where an environment would begin anew, stands still."""
    with contextlib.suppress(SimulationError):
        sim.step(steps)


def few_standing(name: str, sim: Simulation) -> int:
    """How many bare worlds of a task have a body with a fault, which stands still from then on.

    Raises:
        InputError: More than `STILL` of them.
    """
    count = int(np.any(sim.last_readout.fault.numpy() != 0, axis=1).sum())
    if count > STILL * sim.model.worlds:
        raise InputError(
            f"{count} of {sim.model.worlds} bare worlds of {name} have a fault and stand still; allowed: up to "
            f"{STILL:.0%}, for those cost less"
        )
    return count


def told_standing(found: dict[str, dict[int, dict[str, Any]]]) -> str:
    """Sentences of the table's note, one for each row with bare worlds that stood still; none as a rule."""
    return "".join(
        f" Of the {w:,} bare worlds of `{name}` up to {c['still']:,} stood still after a fault."
        for name, by_worlds in found.items() for w, c in by_worlds.items() if c["still"]
    )  # fmt: skip


def periods_in_turns(
    batch: Batch, bare: dict[str, tuple[Simulation, Callable[[], object]]], row: int, turns: int
) -> dict[str, float]:
    """Mean time of a period of environments, and of bare worlds from where those are at its start [s].

    Args:
        batch: The environments.
        bare: Bare worlds, and what takes a period of them.
        row: Periods in a row, between which nobody waits; bare traps glide on.
        turns: How many such rows of each.

    Raises:
        InputError: See `few_standing`; the largest number of worlds is in the result as `still`.
    """
    taken, still = dict.fromkeys([*bare, "step"], 0.0), 0

    def many(work: Callable[[], object]) -> float:
        """Time of a row of periods."""
        return elapsed(lambda: [work() for _ in range(row)], batch.device).wall

    for _ in range(turns):
        for name, (sim, work) in bare.items():
            alike(sim, batch)
            taken[name] += many(work)
            still = max(still, few_standing(batch.task.name, sim))
        taken["step"] += many(batch.step)
    return {**{name: t / (row * turns) for name, t in taken.items()}, "still": still}


def called(batch: Batch, arrays: Any) -> Callable[[], object]:
    """A step as users call it, of as many environments: actions are checked, and arrays of a kind go in and out."""
    env = VectorEnv(batch.task, batch.worlds, device=str(batch.device), arrays=arrays, autoreset_mode="SameStep")
    env.reset(seed=0)
    actions = batch.actions.numpy().copy() if arrays == "numpy" else wp.to_torch(batch.actions).clone()
    return lambda: env.step(actions)


def costs(name: str, device: wp.Device, worlds: int, rounds: int, seconds: float) -> dict[str, Any]:
    """Time of an environment step of all worlds [s], over bare time steps, and as users call it with `ARRAYS`."""
    batch = Batch(task_of(name), worlds, device=device, autoreset="same")
    acting(batch)
    free, ending = bare_worlds(batch), bare_worlds(batch, ends=())
    bare = {"bare": (free, partial(go_on, free, batch.steps)), "ending": (ending, ending.capture(batch.steps))}
    stepped = per_step(batch.step, device, seconds)
    # where bodies touch, what a period costs depends on where they are: then each begins where the environments do
    episode = round(batch.task.time_limit * batch.task.rate)
    row = 1 if batch.sim.model.features.contacts else max(1, min(episode, round(seconds / stepped())))
    periods_in_turns(batch, bare, row, 1)
    turns = max(1, round(seconds / (row * stepped())))
    found = [periods_in_turns(batch, bare, row, turns) for _ in range(rounds)]
    calls = {arrays: (per_step(called(batch, arrays), device, seconds), stepped) for arrays in ARRAYS}

    def over(kind: str) -> Quartiles:
        """Ratio to bare worlds of a kind, round by round."""
        return Pairs([f["step"] for f in found], [f[kind] for f in found]).ratio()

    return {
        "step": Quartiles.of([f["step"] for f in found]),
        "bare": over("bare"),
        "ending": over("ending"),
        **{arrays: pairs.ratio() for arrays, pairs in interleaved(calls, rounds).items()},
        "still": int(max(f["still"] for f in found)),
        "steps": batch.steps,
        "driver": batch.sim.model.features.driver,
    }


def measure(device: str = "cpu", *, worlds: Sequence[int] = (), rounds: int = 5, seconds: float = 0.3) -> Section:
    """Steps a second of each task, and beside what others state."""
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    names = [name for name in MEASURED if name in TASKS]
    wide = tuple(worlds) or WORLDS
    found = {
        name: {w: costs(name, place, w, rounds, seconds) for w in wide if w <= SLOW.get((name, kind), w)}
        for name in names
    }
    rows, beside = [], []
    for name, by_worlds in found.items():
        for w, c in by_worlds.items():
            rate = w / c["step"].median
            ratios = [c[n].text(".3f") if n in c else "–" for n in ("bare", "ending", "numpy", "torch")]
            rows.append((f"`{name}`", f"{w:,}", str(c["steps"]), f"{rate:.3g}", f"{rate / task_of(name).rate:.3g}",
                         *ratios))  # fmt: skip
        best = max(w / c["step"].median for w, c in by_worlds.items())
        beside += [(f"`{name}`", what, f"{published:.3g}", f"{best / published:.3g}")
                   for what, published in PUBLISHED.items()]  # fmt: skip
    tables = [
        Table(
            title="Environment steps",
            head=("task", "environments", "time steps in each", "steps/s, all together", "times real time",
                  "over bare time steps", "over those of worlds that may end", "with NumPy arrays, over without",
                  "with tensors of torch, over without"),
            rows=rows,
            note="An environment step has the time steps of a control period, actions, resets, observations, rewards "
            "and ends, as one graph; bare time steps are those alone, of as many worlds, whose traps glide as those of "
            "the environments do. Where bodies touch, bare worlds take each period from where the environments are at "
            "its start, one after the other; elsewhere, as many periods in a row as an episode has at most. Beads that "
            "are alike share vectors of a CPU, unless their worlds may end (`ends=()`, as one graph). With arrays: a "
            "step of `VectorEnv`, which checks its actions, over the graph alone. All of it on one core of a CPU."
            + told_standing(found),
        ),
        Table(
            title="The quickest of these beside what others state, of other tasks on other machines",
            head=("task", "beside", "steps/s there", "here over there"),
            rows=beside,
        ),
    ]  # fmt: skip
    data = {
        name: {
            str(w): {
                **{n: vars(c[n]) for n in ("step", "bare", "ending", *ARRAYS)},
                "steps": c["steps"],
                "still": c["still"],
                "driver": c["driver"],
            }
            for w, c in by_worlds.items()
        }
        for name, by_worlds in found.items()
    }
    asked = f"--worlds {' '.join(map(str, worlds))}" if worlds else ""
    return Section(name="envs", kind=kind, machine=Machine.look(place), tables=tables, data=data, asked=asked)


if __name__ == "__main__":
    command(
        measure,
        "Environments: steps a second, and what they add to bare time steps.",
        rounds=5,
        worlds={"type": positive, "nargs": "+", "default": (), "help": "environments that are timed"},
    )
