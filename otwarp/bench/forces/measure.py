"""Error against run time of every force model: one bead in one trap, in the step that a user's run takes.

Time is that of `Simulation.step` with Brownian noise, in many worlds, the models in turns with the harmonic trap, one
right after the other. The error is that of the force which the same simulation reads out, in float32 on its device,
against exact forces from NumPy in float64.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.bench.findings import bead_fields
from otwarp.bench.forces.result import Errors, ForcesBench, Row
from otwarp.bench.machine import Machine
from otwarp.bench.rungs import HARMONIC, Rung, TrappedBead, chosen_rungs
from otwarp.bench.timed_rung import SEED, TimedRung
from otwarp.bench.timing import Note, Quartiles, interleaved
from otwarp.bench.typed import check_least
from otwarp.device import pick_device
from otwarp.optics import Beam, Particle, build_table, evaluate

WORLDS = {"cpu": 4096, "cuda": 1 << 20}
"""Beads by kind of device: enough to fill it."""

SECONDS = 0.1
"""Length of one measured call, unless a single step takes longer."""

REGION_PROBES, THERMAL_PROBES = 4000, 1000


@dataclass(frozen=True, eq=False)
class Probes:
    """Where the models are judged, and the exact forces there.

    Attributes:
        region, thermal: (n, 3) float32 sphere centres from the focus [µm]: spread evenly over the trap region, and
            drawn from the distribution of the trapped bead.
        exact_region, exact_thermal: (n, 3) forces [pN].
        estimate: Their estimated error [pN].
        peak: Largest force of the trap [pN].
    """

    region: np.ndarray
    thermal: np.ndarray
    exact_region: np.ndarray
    exact_thermal: np.ndarray
    estimate: float
    peak: float

    @classmethod
    def draw(cls, bead: TrappedBead, *, region: int, thermal: int) -> Probes:
        """Draw points and evaluate the exact force at the places that float32 makes of them."""
        rng = np.random.default_rng(SEED)
        way = rng.standard_normal((region, 3))
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        inside = bead.centre + way * bead.region * np.cbrt(rng.uniform(0.0, 1.0, (region, 1)))
        around = bead.thermal_points(thermal, rng)
        points = [p.astype(np.float32) for p in (inside, around)]
        found = [evaluate(bead.beam, bead.sphere, p.astype(float)) for p in points]
        scale = bead.beam.force_scale
        # the peak by which tables bound their errors; kept out of the cache, or that row's build would not be timed
        table = build_table(bead.beam, bead.sphere, tolerance=1e-2, cache=False)
        return cls(
            *points,
            *(scale * e.force for e in found),
            estimate=scale * max(e.error for e in found),
            peak=scale * table.peak,
        )

    def errors(self, force_at: Callable[[np.ndarray], np.ndarray]) -> Errors:
        """Errors of a force model, over the peak."""
        found = []
        for points, exact in ((self.region, self.exact_region), (self.thermal, self.exact_thermal)):
            distance = np.linalg.norm(force_at(points) - exact, axis=1) / self.peak
            found += [float(np.sqrt(np.mean(distance**2))), float(distance.max())]
        return Errors(rms=found[0], largest=found[1], thermal_rms=found[2], thermal_largest=found[3])


def bench_forces(
    beam: Beam,
    sphere: Particle,
    *,
    models: Sequence[str] = (),
    device: str | None = None,
    worlds: int | None = None,
    rounds: int = 7,
    time_step: float | None = None,
    seconds: float = SECONDS,
    probes: tuple[int, int] = (REGION_PROBES, THERMAL_PROBES),
    fast_math: bool = False,
    note: Note = lambda text: None,
) -> ForcesBench:
    """Measure the force models.

    Args:
        beam: The trap, at the power of the run.
        sphere: The bead.
        models: Names of rungs of `LADDER`, none for all. The harmonic one is always measured.
        device: `cpu`, `cuda:0`, … or None for the best available.
        worlds: Beads; None for `WORLDS`.
        rounds: Repeats.
        time_step: The same for all models [s]; None for `TrappedBead.time_step`.
        seconds: Length of one measured call; compilation and the first calls do not count.
        probes: Points of the trap region and thermal points on which errors are judged.
        fast_math: As for `Simulation`.
        note: Hears what is being done.

    Raises:
        InputError: An argument out of range, or a trap that does not hold the bead.
    """
    rungs = chosen_rungs(models)
    check_least("--worlds", worlds, 1)
    check_least("--rounds", rounds, 1)
    place = pick_device(device)
    machine = Machine.look(place)
    bead = TrappedBead(beam, sphere)
    step = bead.time_step if time_step is None else time_step
    beads = worlds or WORLDS[machine.kind]
    note("exact forces")
    judged = Probes.draw(bead, region=probes[0], thermal=probes[1])
    how: dict[str, Any] = {"worlds": beads, "time_step": step, "seconds": seconds, "fast_math": fast_math}
    runners, errors = _judged_runners(judged, bead, rungs, place, note, **how)
    return ForcesBench(
        **machine.about(fast_math=fast_math),
        **bead_fields(beam, sphere),
        worlds=beads,
        time_step=step,
        rounds=rounds,
        peak=judged.peak,
        region=bead.region,
        spread=tuple(bead.spread.tolist()),
        probes=probes,
        reference_error=judged.estimate / judged.peak,
        rows=_rows(runners, errors, rounds, note),
    )


def _judged_runners(
    judged: Probes, bead: TrappedBead, rungs: Sequence[Rung], device: wp.Device, note: Note, **how: Any
) -> tuple[dict[str, TimedRung], dict[str, Errors | None]]:
    """By name of the rung, its runner, made with `how`, and its errors: none without a trap."""
    runners, errors = {}, {}
    for rung in rungs:
        note(f"{rung.label}: building")
        runner = TimedRung(bead, rung, device, **how)
        runners[rung.name] = runner
        errors[rung.name] = judged.errors(runner.force_at) if rung.family != "none" else None
    return runners, errors


def _rows(runners: dict[str, TimedRung], errors: dict[str, Errors | None], rounds: int, note: Note) -> tuple[Row, ...]:
    """Measure the costs [ns per bead-step], each in turns with the harmonic one, and put them beside the errors."""
    base = runners[HARMONIC].sample
    turns = {name: (runner.sample, base) for name, runner in runners.items()}
    pairs = interleaved(turns, rounds, note=lambda name: note(f"{runners[name].rung.label}: measuring"))
    return tuple(
        _row(runner, Quartiles.of(pairs[name].first), pairs[name].ratio(), errors[name])
        for name, runner in runners.items()
    )


def _row(runner: TimedRung, cost: Quartiles, ratio: Quartiles, errors: Errors | None) -> Row:
    rung = runner.rung
    return Row(
        name=rung.name,
        label=rung.label,
        family=rung.family,
        tolerance=rung.tolerance,
        cost=cost,
        ratio=ratio,
        errors=errors,
        table_bytes=runner.table_bytes(),
        build_seconds=runner.build_seconds,
        steps=runner.steps,
    )
