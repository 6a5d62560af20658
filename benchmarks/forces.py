"""What each digit of force accuracy costs: the section of `otwarp bench forces` for docs/benchmarks/forces.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from benchmarks.report import Section, command
from otwarp.bench.forces.measure import REGION_PROBES, SECONDS, THERMAL_PROBES, bench_forces
from otwarp.bench.forces.table import table
from otwarp.bench.machine import Machine
from otwarp.device import pick_device
from otwarp.optics import Beam, Particle

BEAM = Beam(numerical_aperture=1.2, power=20.0)
SPHERE = Particle(radius=1.0, index=1.59)

HOW_TO_READ = (
    "Go down the table until the error suits the question, in the region if beads are dragged or escape and at the "
    "trapped bead if they only fluctuate: the third and fourth columns are what that row costs a run. A row that is "
    "both slower and less accurate than another is never worth its time."
)


def measure(
    device: str = "cpu",
    *,
    models: Sequence[str] = (),
    beam: Beam = BEAM,
    sphere: Particle = SPHERE,
    rounds: int = 7,
    worlds: int | None = None,
    seconds: float = SECONDS,
    probes: tuple[int, int] = (REGION_PROBES, THERMAL_PROBES),
) -> Section:
    """All force models, or those named; see `bench_forces`."""
    place = pick_device(device)
    how: dict = {"models": models, "device": device, "worlds": worlds, "rounds": rounds}
    tables, data = [], {}
    # fast_math changes nothing but the noise's functions on a CPU
    for fast_math in (False,) if place.is_cpu else (False, True):
        found = bench_forces(beam, sphere, seconds=seconds, probes=probes, fast_math=fast_math, **how)
        title = "Force models: error against run time" + (", `fast_math`" if fast_math else "")
        measured = table(found, title)
        tables.append(replace(measured, note=f"{HOW_TO_READ}\n\n{measured.note}"))
        data["fast_math" if fast_math else "accurate"] = found.json()
    kind = "cpu" if place.is_cpu else "cuda"
    return Section(name="forces", kind=kind, machine=Machine.look(place), tables=tables, data=data)


if __name__ == "__main__":
    command(measure, "Error against run time of the force models.", rounds=7)
