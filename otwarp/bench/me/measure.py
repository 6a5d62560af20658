"""What scenes cost here: a step, a run, a thousand runs, and what comes before the first step.

On a CPU processor time of one thread, which a busy machine does not blur; on a GPU wall time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

import warp as wp

from otwarp.bench.findings import Findings
from otwarp.bench.machine import Machine
from otwarp.bench.timing import Quartiles, calls_for, elapsed
from otwarp.device import pick_device
from otwarp.scene import Scene
from otwarp.shipped import shipped
from otwarp.simulation.info import device_bytes
from otwarp.simulation.simulation import Simulation

SHOWN = ("single_bead", "table_trap", "strategy_b", "cell_delivery", "microfluidic_channel", "ten_thousand_cells")
"""Shipped scenes that are measured where none is named: from one bead to many bodies."""

BODIES = {"cpu": 8192, "cuda": 1 << 18}
"""In all worlds together, by kind of device; of a scene that has more of them, there is one world."""

WORLDS = {"cpu": 1024, "cuda": 1 << 16}
"""Worlds at most."""

RUNS = 1000
"""Runs that are asked for together."""


@dataclass(frozen=True, kw_only=True)
class SceneBill:
    """What one scene costs; times are those of one core, or of the GPU.

    Attributes:
        name: Of its file.
        bodies: How many there are.
        duration: Of a run, as the scene says [s].
        time_step: [s].
        ready: Time until the first step was done: model, kernels that were not in the cache [s].
        step: Time of a step of one world [s].
        factor: Simulated seconds per second, one world.
        worlds: That were stepped at once.
        all_factor: Simulated seconds of all worlds together per second.
        bytes_per_world: Of memory on the device.
    """

    name: str
    bodies: int
    duration: float
    time_step: float
    ready: float
    step: Quartiles
    factor: Quartiles
    worlds: int
    all_factor: Quartiles
    bytes_per_world: float

    @property
    def run(self) -> float:
        """Time of one run [s]."""
        return self.duration / self.factor.median

    @property
    def runs(self) -> float:
        """Time of `RUNS` of them, as many at once as were measured [s]."""
        return RUNS * self.duration / max(self.all_factor.median, self.factor.median)


@dataclass(frozen=True, kw_only=True)
class MyBench(Findings):
    """What `otwarp bench me` found.

    Attributes:
        scenes: A bill for each.
    """

    FORMAT: ClassVar[str] = "otwarp bench me"

    scenes: list[SceneBill]


def bench_me(
    scenes: Sequence[Path] = (),
    device: str | None = None,
    *,
    worlds: int | None = None,
    rounds: int = 3,
    seconds: float = 0.5,
    note: Callable[[str], None] = lambda text: None,
) -> MyBench:
    """Measure scenes.

    Args:
        scenes: Their files; none for some shipped ones.
        device: `cpu`, `cuda:0`, … or None for the best available.
        worlds: That are stepped at once; None for as many as hold `BODIES`, at most `WORLDS`.
        rounds: Samples of each, each from the scene's start.
        seconds: Length of a sample [s].
        note: Called with what is being done.

    Raises:
        InputError: A scene that cannot be loaded, before anything is measured.
    """
    place = pick_device(device)
    machine = Machine.look(place)
    files = [*scenes] or [shipped("scenes", name) for name in SHOWN]
    loaded = [Scene.load(file) for file in files]
    bills = []
    for file, scene in zip(files, loaded, strict=True):
        note(f"{file.stem} …")
        bills.append(_bill(file.stem, scene, place, machine.kind, worlds, rounds, seconds))
    return MyBench(**machine.about(), scenes=bills)


def _bill(
    name: str, scene: Scene, device: wp.Device, kind: str, worlds: int | None, rounds: int, seconds: float
) -> SceneBill:
    made: list[Simulation] = []

    def begin() -> None:
        """Model, kernels, and the first step."""
        made.append(Simulation(scene, device=device, threads=1))
        made[0].step()

    ready = elapsed(begin, device).on(device)
    (sim,) = made
    many = worlds or max(1, min(WORLDS[kind], BODIES[kind] // max(1, len(scene.bodies))))
    one = _samples(scene, device, 1, rounds, seconds)
    all_of_them = one if many == 1 else _samples(scene, device, many, rounds, seconds)
    step = sim.time_step
    more = Simulation(scene, worlds=2, device=device, threads=1)
    held = [device_bytes(s.model, s.state, s.control, s.readout) for s in (sim, more)]
    return SceneBill(
        name=name, bodies=len(scene.bodies), duration=scene.settings.duration, time_step=step, ready=ready,
        step=Quartiles.of(one), factor=Quartiles.of([step / each for each in one]),
        worlds=many, all_factor=Quartiles.of([many * step / each for each in all_of_them]),
        bytes_per_world=float(held[1] - held[0]),
    )  # fmt: skip


def _samples(scene: Scene, device: wp.Device, worlds: int, rounds: int, seconds: float) -> list[float]:
    """Time of a step of all worlds [s], from the scene's start on, for about `seconds` or its whole run."""
    sim = Simulation(scene, worlds=worlds, device=device, threads=1)
    whole = max(1, round(scene.settings.duration / sim.time_step))
    steps = min(whole, calls_for(sim.step, device, seconds))
    found = []
    for _ in range(rounds):
        sim = Simulation(scene, worlds=worlds, device=device, threads=1)
        sim.step()  # what only the first launch of a new simulation costs is no cost of a step
        found.append(elapsed(partial(sim.step, steps), device).on(device) / steps)
    return found
