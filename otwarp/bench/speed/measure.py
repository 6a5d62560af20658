"""How fast otwarp steps: the same composed step that a user's run takes, beside codes written for one workload."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

from otwarp.bench.machine import Machine
from otwarp.bench.speed.result import SpeedBench, SpeedRow
from otwarp.bench.speed.workloads import BEAD_PEERS, CASES, PeerCode, Prepared, Setting, Workload, workloads
from otwarp.bench.timing import Note, Pairs, Quartiles, calls_for, elapsed, interleaved
from otwarp.bench.typed import check_least, check_names
from otwarp.device import pick_device
from otwarp.errors import InputError

SECONDS = 0.2
"""Length of one measured call, unless the least number of steps takes longer."""

LEAST_STEPS = 200
"""Steps before variances are looked at: e^{−2·0.05·200} is nothing."""


class TimedWorkload:
    """A prepared workload, ready to be sampled."""

    def __init__(self, work: Workload, ready: Prepared, setting: Setting, seconds: float):
        self.work, self.ready, self.device = work, ready, setting.device
        self.steps = max(work.least_steps, calls_for(ready.step, setting.device, seconds))
        self.cores: list[float] = []

    def sample(self) -> float:
        """Seconds per unit of work: by the wall clock on a GPU or with threads, else of the process."""
        taken = elapsed(partial(self.ready.step, self.steps), self.device)
        self.cores.append(taken.cpu / taken.wall)
        spent = taken.wall if self.work.wall or not self.device.is_cpu else taken.cpu
        return spent / (self.steps * self.ready.per_step)

    def label(self) -> str:
        """Its own name, and where threads are timed how many cores it got."""
        got = f" (got {Quartiles.of(self.cores).median:.2f} cores)" if self.work.wall else ""
        # a neighbour that takes the other core would make threads look useless
        return (self.ready.name or self.work.label) + got

    def check(self) -> float | None:
        """Stationary variance over the exact one of the scheme."""
        if self.ready.check is None:
            return None
        self.ready.step(LEAST_STEPS)
        return self.ready.check()


def bench_speed(
    *,
    cases: Sequence[str] = (),
    device: str | None = None,
    rounds: int = 7,
    seconds: float = SECONDS,
    scale: float = 1.0,
    bead_peers: Sequence[PeerCode] = BEAD_PEERS,
    many_body_peers: Sequence[PeerCode] = (),
    note: Note = lambda text: None,
) -> SpeedBench:
    """Measure the workloads.

    Args:
        cases: Names of `CASES`, none for all.
        device: `cpu`, `cuda:0`, … or None for the best available.
        rounds: Repeats.
        seconds: Length of one measured call; compilation and the first calls do not count.
        scale: Part of the usual number of worlds and particles; those of `scaling` do not follow.
        bead_peers, many_body_peers: Other codes for the cases `bead` and `crowd`.
        note: Hears what is being done.

    Raises:
        InputError: An argument out of range.
    """
    check_names("--case", cases, CASES)
    check_least("--rounds", rounds, 1)
    for name, value in (("seconds", seconds), ("scale", scale)):
        if not 0.0 < value < math.inf:
            raise InputError(f"--{name} is {value:g}; allowed: above 0, finite")
    place = pick_device(device)
    setting = Setting(place, scale)
    machine = Machine.look(place)
    groups: dict[str, list[Workload]] = {}
    for work in workloads(setting.kind, bead_peers, many_body_peers):
        if not cases or work.case.split()[0] in cases:
            groups.setdefault(work.case, []).append(work)
    rows: list[SpeedRow] = []
    for group in groups.values():
        rows += measure_case(group, setting, rounds=rounds, seconds=seconds, note=note)
    return SpeedBench(**machine.about(), rounds=rounds, rows=tuple(rows))


def measure_case(
    group: Sequence[Workload], setting: Setting, *, rounds: int, seconds: float, note: Note
) -> list[SpeedRow]:
    """Rows of one case, each measured in turns with the first; what cannot run here says why."""
    ready: dict[str, TimedWorkload] = {}
    skipped: dict[str, str] = {}
    for work in group:
        note(f"{work.label}: building")
        try:
            ready[work.label] = TimedWorkload(work, work.make(setting), setting, seconds)
        except ImportError as error:
            skipped[work.label] = " ".join(str(error).split())
    base = next(iter(ready.values()), None)
    pairs = interleaved(
        {label: (one.sample, base.sample) for label, one in ready.items() if base},
        rounds,
        note=lambda label: note(f"{label}: measuring"),
    )
    rows = []
    for work in group:
        about = {"case": work.case, "unit": work.unit, "peer": work.peer, "goal": work.goals.get(setting.kind)}
        if work.label in skipped:
            rows.append(SpeedRow(**about, label=work.label, worlds=0, skipped=skipped[work.label]))
        else:
            one, (ours, first) = ready[work.label], pairs[work.label]
            rate = Quartiles.of([1.0 / s for s in ours])
            ratio = None if one is base else Pairs(first, ours).ratio()
            check = one.check()
            rows.append(
                SpeedRow(**about, label=one.label(), worlds=one.ready.worlds, rate=rate, ratio=ratio, check=check)
            )
    return rows
