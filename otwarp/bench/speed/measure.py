"""How fast otwarp steps: the same composed step that a user's run takes, beside codes written for one workload."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

from otwarp.bench.machine import Machine
from otwarp.bench.speed.result import SpeedBench, SpeedRow
from otwarp.bench.speed.workloads import CASES, Runner, Setting, Workload, workloads
from otwarp.bench.timing import Spread, calls_for, elapsed, interleaved
from otwarp.device import pick_device
from otwarp.errors import InputError

SECONDS = 0.2
"""Length of one measured call, unless the least number of steps takes longer."""

LEAST_STEPS = 200
"""Steps before variances are looked at: e^{−2·0.05·200} is nothing."""

Note = Callable[[str], None]
"""Called with what is being done, often enough to stop there."""


class Measured:
    """A prepared workload, ready to be sampled."""

    def __init__(self, work: Workload, runner: Runner, setting: Setting, seconds: float):
        self.work, self.runner, self.device = work, runner, setting.device
        self.steps = max(work.least_steps, calls_for(runner.step, setting.device, seconds))
        self.cores: list[float] = []

    def sample(self) -> float:
        """Seconds per unit of work."""
        taken = elapsed(partial(self.runner.step, self.steps), self.device)
        self.cores.append(taken.cpu / taken.wall)
        spent = taken.wall if self.work.wall or not self.device.is_cpu else taken.cpu
        return spent / (self.steps * self.runner.per_step)

    def check(self) -> float | None:
        """Stationary variance over the exact one of the scheme."""
        if self.runner.check is None:
            return None
        self.runner.step(LEAST_STEPS)
        return self.runner.check()


def bench_speed(
    *,
    cases: Sequence[str] = (),
    device: str | None = None,
    rounds: int = 7,
    seconds: float = SECONDS,
    scale: float = 1.0,
    note: Note = lambda text: None,
) -> SpeedBench:
    """Measure the workloads.

    Args:
        cases: Names of `CASES`, none for all.
        device: `cpu`, `cuda:0`, … or None for the best available.
        rounds: Repeats.
        seconds: Length of one measured call; compilation and the first calls do not count.
        scale: Part of the usual number of worlds and particles; those of `scaling` do not follow.
        note: Hears what is being done.

    Raises:
        InputError: An argument out of range.
    """
    for name in cases:
        if name not in CASES:
            raise InputError(f"--case is {name!r}; allowed: {', '.join(CASES)}")
    if rounds < 1:
        raise InputError(f"--rounds is {rounds}; allowed: 1 or more")
    for name, value in (("seconds", seconds), ("scale", scale)):
        if not 0.0 < value < math.inf:
            raise InputError(f"--{name} is {value:g}; allowed: above 0, finite")
    place = pick_device(device)
    setting = Setting(place, scale)
    machine = Machine.look(place)
    groups: dict[str, list[Workload]] = {}
    for work in workloads(setting.kind):
        if (not cases or work.case.split()[0] in cases) and setting.kind in work.kinds:
            groups.setdefault(work.case, []).append(work)
    rows: list[SpeedRow] = []
    for group in groups.values():
        rows += measure_case(group, setting, rounds=rounds, seconds=seconds, note=note)
    return SpeedBench(
        kind=setting.kind, hardware=machine.name(), machine=machine.data(), rounds=rounds, rows=tuple(rows)
    )


def measure_case(
    group: Sequence[Workload], setting: Setting, *, rounds: int, seconds: float, note: Note
) -> list[SpeedRow]:
    """Rows of one case, each measured in turns with the first; what cannot run here says why."""
    ready: dict[str, Measured] = {}
    skipped: dict[str, str] = {}
    for work in group:
        note(f"{work.label}: building")
        try:
            ready[work.label] = Measured(work, work.make(setting), setting, seconds)
        except ImportError as error:
            skipped[work.label] = " ".join(str(error).split())
    pairs = {}
    if ready:
        base = next(iter(ready.values()))

        def noted(one: Measured) -> Callable[[], float]:
            def measure() -> float:
                note(f"{one.work.label}: measuring")
                return one.sample()

            return measure

        pairs = interleaved({label: (noted(one), base.sample) for label, one in ready.items()}, rounds)
    rows = []
    for work in group:
        fields = {"case": work.case, "label": work.label, "unit": work.unit, "peer": work.peer}
        goal = work.goals.get(setting.kind)
        if work.label in skipped:
            rows.append(SpeedRow(**fields, worlds=0, goal=goal, skipped=skipped[work.label]))
            continue
        one, pair = ready[work.label], pairs[work.label]
        first = one is base
        ratio = None if first else Spread.of([b / a for a, b in zip(pair.first, pair.second, strict=True)])
        rate = Spread.of([1.0 / s for s in pair.first])
        fields["label"] = one.runner.name or work.label
        if work.wall:
            # a neighbour that takes the other core would make threads look useless
            fields["label"] += f" (got {Spread.of(one.cores).median:.2f} cores)"
        rows.append(SpeedRow(**fields, worlds=one.runner.worlds, rate=rate, ratio=ratio, goal=goal, check=one.check()))
    return rows
