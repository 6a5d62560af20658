"""What each digit of force accuracy costs: the section of `otwarp bench forces` for docs/benchmarks.md."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.report import Section, Table, command, options, save_json
from otwarp.bench.forces import REGION_PROBES, SECONDS, THERMAL_PROBES, bench_forces
from otwarp.bench.machine import Machine
from otwarp.bench.table import HEAD, caption, table_rows
from otwarp.device import pick_device
from otwarp.optics import Beam, Sphere

BEAM = Beam(numerical_aperture=1.2, power=20.0)
SPHERE = Sphere(radius=1.0, index=1.59)

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
    sphere: Sphere = SPHERE,
    rounds: int = 7,
    worlds: int | None = None,
    seconds: float = SECONDS,
    probes: tuple[int, int] = (REGION_PROBES, THERMAL_PROBES),
) -> Section:
    """All force models, or those named; see `bench_forces`."""
    machine = Machine.look(pick_device(device))
    found = bench_forces(
        beam, sphere, models=models, device=device, worlds=worlds, rounds=rounds, seconds=seconds, probes=probes
    )
    table = Table(
        title="Force models: error against run time",
        head=HEAD,
        rows=table_rows(found),
        note=f"{HOW_TO_READ}\n\n{caption(found)}",
    )
    return Section(name="forces", kind=found.kind, machine=machine, tables=[table], data=found.json())


def main() -> None:
    """Command line."""
    arguments = options("Error against run time of the force models.", rounds=7).parse_args()
    section = measure(arguments.device, rounds=arguments.rounds)
    print(section.markdown())
    if arguments.json:
        save_json(arguments.json, [section])


if __name__ == "__main__":
    command(main)
