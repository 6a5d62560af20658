"""Environments whose scenes differ: what a step of all costs with several models over that with one."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from benchmarks.report import Section, command
from otwarp import studies
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, calls_for, elapsed, interleaved
from otwarp.device import pick_device
from otwarp.envs.grouped import GroupedVectorEnv
from otwarp.envs.randomise.groups import MOST
from otwarp.envs.registration import task_of

TASK, RADIUS = "otwarp/Navigate-v0", "/World/robot/sphere.radius"
SIZES = ((8, 64), (MOST, 64), (8, 4_096), (MOST, 4_096))
"""Models and environments."""


def environments(models: int, worlds: int, device: str) -> GroupedVectorEnv:
    """So many of the task, whose robot has one of so many radii."""
    radii = studies.values(list(np.linspace(2.4, 2.6, models)) if models > 1 else [2.5], unit="µm")
    return GroupedVectorEnv(task_of(TASK, randomise={RADIUS: radii}), worlds, device=device, autoreset_mode="SameStep")


def steps_of(envs: GroupedVectorEnv) -> Callable[[int], None]:
    """Takes so many steps as users call them, with arrays of NumPy."""
    envs.reset(seed=0)
    actions = np.random.default_rng(1).uniform(-0.3, 0.3, envs.action_space.shape).astype(np.float32)  # type: ignore[arg-type]

    def steps(calls: int) -> None:
        """Takes them."""
        for _ in range(calls):
            envs.step(actions)

    return steps


def costs(models: int, worlds: int, device: wp.Device, rounds: int, seconds: float) -> dict[str, Any]:
    """Time of a step with several models over one with one model, and what building several takes [s]."""
    begun = time.perf_counter()
    several = environments(models, worlds, str(device))
    built = time.perf_counter() - begun
    work = [steps_of(envs) for envs in (several, environments(1, worlds, str(device)))]
    calls = [calls_for(steps, device, seconds) for steps in work]

    def timed(k: int) -> Callable[[], float]:
        """A measurement of one step [s]."""
        return lambda: elapsed(lambda: work[k](calls[k]), device).on(device) / calls[k]

    pairs = interleaved({"": (timed(0), timed(1))}, rounds)[""]
    return {"over": pairs.ratio(), "step": Quartiles.of(pairs.first), "built": built}


def measure(device: str = "cpu", *, rounds: int = 5, seconds: float = 0.3) -> Section:
    """The table."""
    place = pick_device(device)
    environments(1, 1, str(place))  # compiles
    found = {size: costs(*size, place, rounds, seconds) for size in SIZES}
    rows = [
        (f"{models}", f"{worlds:,}", f"{1e3 * c['step'].median:.3g}", c["over"].text(".3g"), f"{c['built']:.3g}")
        for (models, worlds), c in found.items()
    ]
    table = Table(
        title="`otwarp/Navigate-v0` with robots of several radii, each a model of its own",
        head=("models", "environments", "a step of all [ms]", "over one of one model", "built in [s]"),
        rows=rows,
        note="`GroupedVectorEnv.step` with arrays of NumPy; models are stepped one after the other, in one process.",
    )
    data = {f"{models} models, {worlds}": {"over": vars(c["over"]), "built": c["built"]}
            for (models, worlds), c in found.items()}  # fmt: skip
    kind = "cpu" if place.is_cpu else "cuda"
    return Section(name="envs_grouped", kind=kind, machine=Machine.look(place), tables=[table], data=data)


if __name__ == "__main__":
    command(measure, "Environments whose scenes differ: a step with several models over one with one.", rounds=5)
