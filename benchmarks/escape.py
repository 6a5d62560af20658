"""Rare escapes by forward-flux sampling: mean times against the exact ones, and what they take."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import quad

import otwarp as ot
from benchmarks.report import Section, command, positive
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.laws import TrapLaw
from otwarp.scene import Body, SceneBuilder, Settings, Sphere, Track, Trap
from otwarp.studies.rare.results import interval_of_mean
from otwarp.units import BOLTZMANN

STIFFNESS, RIM, RADIUS, VISCOSITY, KELVIN = 0.5, 0.4, 0.5, 0.00089, 298.15
"""Of the well at 1 mW [pN/µm], where it ends and the bead [µm], and of the medium."""

STEP = 0.02
"""Of the time in which the well relaxes."""

LEVEL = 0.95
"""Of the intervals."""

DEPTHS = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0)


def well(folder: Path) -> Path:
    """The scene: a bead in a harmonic trap that ends."""
    builder = SceneBuilder(settings=Settings(duration=0.5))
    sphere = Sphere(prim="/World/bead/sphere", radius=RADIUS, refractive_index=1.59)
    builder.add(Body(prim="/World/bead", position=(0.0, 0.0, 10.0), spheres=(sphere,)))
    law = TrapLaw(stiffness=STIFFNESS, threshold=RIM, cutoff=RIM, power=1.0)
    place = Track.constant((0.0, 0.0, 10.0))
    builder.add(
        Trap(prim="/World/trap", position=place, power=Track.constant(1.0), radial=law, holds="/World/bead/sphere")
    )
    return builder.save(folder / "well.usda")


def exact(depth: float) -> float:
    """Mean time from the centre to the rim of a well so many k_BT deep, in times in which it relaxes.

    The double integral of Gardiner 2009, Stochastic Methods, section 5.5, in three dimensions; energies in k_BT,
    lengths in deviations of the bead along an axis.
    """
    rim = math.sqrt(2.0 * depth)

    def inner(r: float) -> float:
        """exp(r²/2)/r² ∫₀ʳ s² exp(−s²/2) ds."""
        inside = math.sqrt(0.5 * math.pi) * math.erf(r / math.sqrt(2.0)) - r * math.exp(-0.5 * r * r)
        return math.exp(0.5 * r * r) / (r * r) * inside if r > 1e-3 else r / 3.0

    return quad(inner, 0.0, rim, limit=400, epsrel=1e-10)[0]


def measure(
    device: str = "cpu", *, depths: Sequence[float] = DEPTHS, runs: int = 16, branches: int = 2000, rounds: int = 1
) -> Section:
    """Wells of several depths."""
    place = pick_device(device)
    relaxation_at_1 = 6.0 * math.pi * VISCOSITY * RADIUS / STIFFNESS
    rows, data = [], {}
    with tempfile.TemporaryDirectory() as folder:
        scene = well(Path(folder))
        for depth in depths:
            power = 2.0 * depth * BOLTZMANN * KELVIN / RIM**2 / STIFFNESS
            asked: dict[str, Any] = {"time_step": STEP * relaxation_at_1 / power, "halved": False, "seed": 7}
            study = ot.EscapeStudy(
                scene, axes={"trap_power": ot.values([power], unit="mW")}, runs=runs, branches=branches, **asked
            )
            study.compute([0], device=str(place))  # kernels
            begun, processor = time.perf_counter(), time.process_time()
            for _ in range(rounds):
                found = study.compute([0], device=str(place))[0]
            wall, processor = ((now - then) / rounds for now, then in (
                (time.perf_counter(), begun), (time.process_time(), processor)))  # fmt: skip
            rates = found["rate_of_trial"].ravel() * relaxation_at_1 / power
            ratio = 1.0 / (rates.mean() * exact(depth))
            ends = interval_of_mean(rates, np.ones(len(rates), dtype=bool), LEVEL)
            high, low = (1.0 / (float(end) * exact(depth)) for end in ends)
            said = f"{ratio:.3f} ({low:.3f} – {high:.3f})"
            rows.append((f"{depth:g}", f"{exact(depth):.4g}", said, f"{wall:.3g}", f"{processor:.3g}"))
            data[f"{depth:g}"] = {"ratio": ratio, "low": low, "high": high, "wall": wall, "processor": processor}
    table = Table(
        title="Mean time of escape from a harmonic well that ends, in three dimensions",
        head=("depth [k_BT]", "exact [γ/k]", "found over exact", "wall time [s]", "processor time [s]"),
        rows=rows,
        note=f"{runs} runs of {branches:,} paths an interface, Heun, steps of {STEP:g} γ/k; {100 * LEVEL:g} % "
        "intervals, Student's of the runs. With more runs and paths: docs/validation/escapes.md.",
    )
    kind = "cpu" if place.is_cpu else "cuda"
    return Section(name="escape", kind=kind, machine=Machine.look(place), tables=[table], data={"wells": data})


if __name__ == "__main__":
    command(
        measure,
        "Rare escapes by forward-flux sampling.",
        rounds=1,
        runs={"type": positive, "default": 16, "help": "independent runs"},
        branches={"type": positive, "default": 2000, "help": "paths of each interface"},
    )
