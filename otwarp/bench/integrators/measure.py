"""Error against run time for integrators, force models and precisions: one bead in a tabulated trap.

Three observables: stationary variances and correlations in a well of 20 k_B T, where thermal motion reaches the steep
rim of the force, and the mean escape time from a well of 5 k_B T. Their exact values come from the Fokker–Planck
equation with the same force, so that an integrator's error is not mixed with its table's; the errors of force models
are against the exact force's. Run time is that of `Simulation.step`, in turns with the default.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.bench.findings import bead_fields
from otwarp.bench.integrators.cases import DEFAULT, PLAIN, Case, all_cases
from otwarp.bench.integrators.fokker_planck import Estimate
from otwarp.bench.integrators.largest_step import StepLimit, largest_step
from otwarp.bench.integrators.observables import (
    PANELS,
    STATIONARY,
    WATCHED,
    Mean,
    measure_escape,
    measure_stationary,
)
from otwarp.bench.integrators.result import WANTED, IntegratorsBench, Line, Point
from otwarp.bench.integrators.wells import DEEP, SHALLOW, SplinedForce, Well
from otwarp.bench.machine import Machine
from otwarp.bench.timed_rung import TimedRung
from otwarp.bench.timing import Note, Pairs, Quartiles, interleaved
from otwarp.bench.typed import check_least
from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.optics import Beam, Particle
from otwarp.simulation.drivers.compilation import usable_cores
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.capacity import check_worlds
from otwarp.simulation.simulation import Simulation

WORLDS = {"cpu": 4096, "cuda": 1 << 20}
"""Beads of a timed call."""

AVERAGED = {"cpu": 4096, "cuda": 1 << 18}
"""Beads behind stationary averages: their positions come to the host at every look."""

ESCAPING = {"cpu": (256, 1 << 16), "cuda": (1 << 18, 1 << 20)}
"""Fewest and most beads behind an escape time."""

STEPS = (100, 50, 25, 14, 10, 7, 5, 4, 3, 2)
"""Steps per relaxation time, 1/z; those too long to be stable are left out."""

TIMED = 20
"""Steps per relaxation time while costs are measured, which do not depend on it."""

SECONDS, CALL = 60.0, 0.05
"""Budget of all errors together, and length of one timed call."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Setup:
    """The two wells, what is true in them, and what a measurement may take.

    Attributes:
        deep, shallow: The wells.
        references: By force model and observable.
        product: z of the step that otwarp chooses for the default in the deep well.
        stable: z of the largest stable one.
        device: Where beads move.
        worlds: Beads of all measurements, None for each one's usual number.
        seconds: Budget of all errors together [s].
        note: Hears what is being done.
    """

    deep: Well
    shallow: Well
    references: dict[str, dict[str, Estimate]]
    product: float
    stable: float
    device: wp.Device
    worlds: int | None
    seconds: float
    note: Note

    @classmethod
    def of(
        cls,
        beam: Beam,
        sphere: Particle,
        cases: Sequence[Case],
        device: wp.Device,
        *,
        worlds: int | None,
        seconds: float,
        note: Note,
    ) -> Setup:
        """Find the wells, and what is true in them for the force models of the cases.

        Raises:
            InputError: A trap that does not suit, or more worlds than memory holds.
        """
        note("wells")
        deep, shallow = Well.of_depth(beam, sphere, DEEP), Well.of_depth(beam, sphere, SHALLOW)
        default = next(c for c in cases if c.name == DEFAULT)
        check_worlds(deep.bead.scene(default.rung), worlds or 1, device)
        near, far = (
            Model.build(w.bead.scene(default.rung), device=device, options=StepOptions(integrator=DEFAULT))
            for w in (deep, shallow)
        )
        note("Fokker–Planck equation")
        return cls(
            deep=deep,
            shallow=shallow,
            references=references(deep, shallow, far, exact=any(c.group == "force" for c in cases)),
            product=near.time_step / deep.relaxation,
            stable=near.scales.largest_stable / deep.relaxation,
            device=device,
            worlds=worlds,
            seconds=seconds,
            note=note,
        )

    @property
    def kind(self) -> str:
        """`cpu` or `cuda`."""
        return "cpu" if self.device.is_cpu else "cuda"

    def simulation(self, case: Case, well: Well, steps: int, worlds: int) -> Simulation:
        """The bead in a well, with so many steps per relaxation time."""
        scene = well.bead.scene(case.rung)
        step = well.relaxation / steps
        # rows with the same noise would err alike, and many of them would look like a bias
        seed = zlib.crc32(f"{case.name} {steps} {well.power}".encode())
        how: dict[str, Any] = {"device": self.device, "seed": seed, **case.settings}
        return Simulation(scene, worlds=worlds, time_step=step, allow_large_step=True, **how)

    def ladder(self, case: Case, steps: Sequence[int]) -> list[int]:
        """Steps per relaxation time: all that are stable, or for force models and precisions the default."""
        if case.group != "integrator":
            return [math.ceil(1.0 / self.product)]
        return sorted((n for n in steps if 1.0 / n < self.stable), reverse=True)

    def errors(
        self, case: Case, steps: int, cost: float, observables: Sequence[str], seconds: float
    ) -> dict[str, Mean]:
        """Relative errors of a case at a step; `cost` is that of one bead-step [ns], `seconds` the budget of each."""
        found: dict[str, Mean] = {}
        note = self.note

        def look() -> None:
            note(f"{case.label}: z = {1.0 / steps:.3g}")

        if set(observables) & set(STATIONARY):
            worlds, well = self.worlds or AVERAGED[self.kind], self.deep
            sim = self.simulation(case, well, steps, worlds)
            how: dict[str, Any] = {"window": steps, "lags": well.lags, "seconds": seconds, "note": look}
            found |= measure_stationary(sim, well.bead.centre, well.start(worlds), **how)
        truth = self.references["exact" if case.group == "force" else "table"]
        if "escape" in observables:
            mean = truth["escape"].value
            worlds = self.worlds or self._escaping(mean / self.shallow.relaxation * steps, cost, seconds)
            found["escape"] = measure_escape(self.simulation(case, self.shallow, steps, worlds), mean, look)
        return {name: relative(found[name], truth[name]) for name in found}

    def _escaping(self, steps: float, cost: float, seconds: float) -> int:
        """Beads whose escapes can be awaited for `WATCHED` times as many steps within the budget."""
        cores = usable_cores() if self.device.is_cpu else 1
        fewest, most = ESCAPING[self.kind]
        return int(np.clip(cores * 1e9 * seconds / (cost * WATCHED * steps), fewest, most))


def relative(found: Mean, truth: Estimate) -> Mean:
    """Relative error and its standard error, that of the reference included."""
    return Mean(found.value / truth.value - 1.0, math.hypot(found.error, truth.error) / truth.value)


def bench_integrators(
    beam: Beam,
    sphere: Particle,
    *,
    axes: Sequence[str] = (),
    device: str | None = None,
    worlds: int | None = None,
    seconds: float = SECONDS,
    rounds: int = 7,
    steps: Sequence[int] = STEPS,
    call: float = CALL,
    fast_math: bool = False,
    note: Note = lambda text: None,
) -> IntegratorsBench:
    """Measure errors and costs.

    Args:
        beam: The trap; its power does not matter.
        sphere: The bead.
        axes: Of `GROUPS`, none for all.
        device: `cpu`, `cuda:0`, … or None for the best available.
        worlds: Beads; None for as many as suit the device and the budget.
        seconds: Budget of all errors together [s of wall time].
        rounds: Repeats of every timed call.
        steps: Steps per relaxation time.
        call: Length of a timed call [s].
        fast_math: For all cases but those that compare precisions.
        note: Hears what is being done.

    Raises:
        InputError: An argument out of range, or a trap that does not suit.
    """
    check_least("--worlds", worlds, 2)
    check_least("--rounds", rounds, 1)
    if not 0.0 < seconds < math.inf:
        raise InputError(f"--seconds is {seconds:g}; allowed: above 0")
    cases = all_cases(axes, fast_math=fast_math)
    place = pick_device(device)
    machine = Machine.look(place)
    setup = Setup.of(beam, sphere, cases, place, worlds=worlds, seconds=seconds, note=note)
    beads = worlds or WORLDS[machine.kind]
    costs = _costs(cases, setup.deep, place, worlds=beads, rounds=rounds, call=call, note=note)
    return IntegratorsBench(
        **machine.about(fast_math=fast_math),
        **bead_fields(beam, sphere),
        worlds=beads,
        rounds=rounds,
        seconds=seconds,
        powers=(setup.deep.power, setup.shallow.power),
        relaxations=(setup.deep.relaxation, setup.shallow.relaxation),
        lags=setup.deep.lags,
        default=DEFAULT,
        default_product=setup.product,
        references={m: {k: Mean(e.value, e.error) for k, e in of.items()} for m, of in setup.references.items()},
        lines=tuple(_lines(setup, cases, {c.name: setup.ladder(c, steps) for c in cases}, costs)),
    )


def references(deep: Well, shallow: Well, model: Model, *, exact: bool) -> dict[str, dict[str, Estimate]]:
    """By force model, `table` (that of `model`) and if wanted `exact`, and by observable.

    Raises:
        InputError: The bead does not leave the shallow well, or not by itself.
    """
    table, reach = model.optics.tables[0], float(model.held_range[0, 0])
    if not math.isfinite(reach):
        raise InputError("the trap has no reach beyond which a bead has escaped; allowed: a beam that lets go of it")
    fields: dict[str, Callable[[np.ndarray], np.ndarray]] = {"table": table.force}
    if exact:
        bead = deep.bead
        outer = max(reach, bead.region) + abs(bead.properties.equilibrium)
        fields["exact"] = SplinedForce(bead.beam, bead.sphere, outer, str(model.device))
    out = {}
    for name, q in fields.items():
        out[name] = deep.averages(deep.about_centre(q))
        out[name]["escape"] = shallow.escape(shallow.about_centre(q), reach)
    return out


def _costs(
    cases: Sequence[Case], well: Well, device: wp.Device, *, worlds: int, rounds: int, call: float, note: Note
) -> dict[str, Pairs]:
    """Costs of all cases [ns per bead-step] in turns with that of the default."""
    how: dict[str, Any] = {"worlds": worlds, "time_step": well.relaxation / TIMED, "seconds": call}
    runners = {}
    for case in cases:
        note(f"{case.label}: building")
        runners[case.name] = TimedRung(well.bead, case.rung, device, **how, **case.settings)

    base = runners[DEFAULT].sample
    labels = {case.name: case.label for case in cases}
    turns = {name: (runner.sample, base) for name, runner in runners.items()}
    return interleaved(turns, rounds, note=lambda name: note(f"{labels[name]}: timing"))


def _lines(setup: Setup, cases: Sequence[Case], ladder: dict[str, list[int]], costs: dict[str, Pairs]) -> list[Line]:
    """Measure the errors of all cases; `ladder` is that of each."""
    seconds = setup.seconds / sum(len(ladder[c.name]) * (1 if c.name == PLAIN else 2) for c in cases)
    points: dict[str, tuple[Point, ...]] = {}
    for case in cases:
        cost = Quartiles.of(costs[case.name].first).median
        # what happens inside the deep well does not depend on how escapes are seen
        before = points.get("eulerMaruyama") if case.name == PLAIN else None
        found = []
        for i, n in enumerate(ladder[case.name]):
            wanted = PANELS["escape"] if before else (*STATIONARY, "escape")
            errors = setup.errors(case, n, cost, wanted, seconds)
            if before:
                errors = {**before[i].errors, **errors}
            found.append(Point(product=1.0 / n, errors=errors))
        points[case.name] = tuple(found)
    return [
        Line(
            name=case.name,
            label=case.label,
            group=case.group,
            cost=Quartiles.of(costs[case.name].first),
            ratio=costs[case.name].ratio(),
            points=points[case.name],
            limits=limits(points[case.name], case) if len(points[case.name]) > 1 else {},
        )
        for case in cases
    ]


def limits(points: Sequence[Point], case: Case) -> dict[str, StepLimit]:
    """By panel, the largest step at which none of its observables is wrong by more than `WANTED`."""
    out = {}
    for panel, names in PANELS.items():
        order = 0.5 if panel == "escape" and not case.sees_crossings else case.order
        found = []
        for name in names:
            seen = [(p.product, p.errors[name]) for p in points if math.isfinite(p.errors[name].value)]
            z, e = [z for z, _ in seen], [e for _, e in seen]
            found.append(largest_step(z, [m.value for m in e], [m.error for m in e], order=order, wanted=WANTED))
        out[panel] = min(found, key=lambda limit: limit.product)
    return out
