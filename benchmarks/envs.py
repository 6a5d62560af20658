"""Environments: steps a second of one, some and many, what they add to bare steps, and beside published rates."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from benchmarks.report import Section, command, positive
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, calls_for, elapsed, interleaved
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


def alike(sim: Simulation, batch: Batch) -> None:
    """Put bodies and traps of bare worlds where those of environments are: other states cost other times."""
    for array in (sim.last_readout.fault, sim.last_readout.fault_count):
        array.zero_()
    for name in ("position", "orientation"):
        if getattr(sim.state, name).size:
            getattr(sim.state, name).assign(getattr(batch.sim.state, name))
    commands = batch.sim.control
    sim.control.set(trap_position=commands.trap_position.numpy(), trap_power=commands.trap_power.numpy())


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


def costs(name: str, device: wp.Device, worlds: int, rounds: int, seconds: float) -> dict[str, Any]:
    """Time of an environment step of all worlds [s], over bare time steps, and with NumPy arrays in and out."""
    batch = Batch(task_of(name), worlds, device=device, autoreset="same")
    acting(batch)
    same = {"worlds": worlds, "device": device, "time_step": batch.sim.time_step, "threads": 1}
    bare, ending = Simulation(batch.scene, **same), Simulation(batch.scene, ends=(), **same)
    for sim in (bare, ending):
        alike(sim, batch)
    graph = ending.capture(batch.steps)
    env = VectorEnv(task_of(name), worlds, device=str(device), autoreset_mode="SameStep")
    env.reset(seed=0)
    actions = batch.actions.numpy().copy()
    stepped = per_step(batch.step, device, seconds)
    still: list[int] = []
    alone, looped = per_step(lambda: go_on(bare, batch.steps), device, seconds), per_step(graph, device, seconds)

    def timed(sim: Simulation, work: Callable[[], float]) -> float:
        """Time of the steps of bare worlds from where those of environments have come to [s]."""
        alike(sim, batch)
        taken = work()
        still.append(few_standing(name, sim))
        return taken

    pairs = {
        "bare": (stepped, partial(timed, bare, alone)),
        "ending": (stepped, partial(timed, ending, looped)),
        "numpy": (per_step(lambda: env.step(actions), device, seconds), stepped),
    }
    found = interleaved(pairs, rounds)
    return {
        "step": Quartiles.of(found["bare"].first),
        "bare": found["bare"].ratio(),
        "ending": found["ending"].ratio(),
        "numpy": found["numpy"].ratio(),
        "still": max(still),
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
            rows.append((f"`{name}`", f"{w:,}", str(c["steps"]), f"{rate:.3g}", f"{rate / task_of(name).rate:.3g}",
                         c["bare"].text(".3f"), c["ending"].text(".3f"), c["numpy"].text(".3f")))  # fmt: skip
        best = max(w / c["step"].median for w, c in by_worlds.items())
        beside += [(f"`{name}`", what, f"{published:.3g}", f"{best / published:.3g}")
                   for what, published in PUBLISHED.items()]  # fmt: skip
    tables = [
        Table(
            title="Environment steps",
            head=("task", "environments", "time steps in each", "steps/s, all together", "times real time",
                  "over bare time steps", "over those of worlds that may end", "with NumPy arrays, over without"),
            rows=rows,
            note="An environment step has the time steps of a control period, actions, resets, observations, rewards "
            "and ends, as one graph; bare time steps are those alone, of as many worlds, whose bodies and traps begin "
            "where those of the environments have come to. Beads that are alike share vectors of a CPU, unless their "
            "worlds may end (`ends=()`, as one graph). All of it on one core of a CPU." + told_standing(found),
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
                **{n: vars(c[n]) for n in ("step", "bare", "ending", "numpy")},
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
