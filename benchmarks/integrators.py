"""The central figure in numbers: the section of `otwarp bench integrators` for docs/benchmarks/integrators.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.report import Section, command
from otwarp.bench.integrators.measure import CALL, SECONDS, STEPS, bench_integrators
from otwarp.bench.integrators.result import IntegratorsBench
from otwarp.bench.integrators.table import caption, tables
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.optics import Beam, Particle

BEAM = Beam(numerical_aperture=1.2)
SPHERE = Particle(radius=1.0, index=1.59)

HOW_TO_READ = (
    "The first table answers which integrator to take: the column `ns per relaxation time` is the least run time that "
    "gives all three observables to 1 %. The second shows the errors behind it, step by step."
)


def measure(
    device: str = "cpu",
    *,
    axes: Sequence[str] = (),
    beam: Beam = BEAM,
    sphere: Particle = SPHERE,
    rounds: int = 7,
    worlds: int | None = None,
    seconds: float = SECONDS,
    steps: Sequence[int] = STEPS,
    call: float = CALL,
    plot: Path | None = None,
) -> Section:
    """All axes, or those named; see `bench_integrators`."""
    place = pick_device(device)
    how: dict = {"axes": axes, "device": device, "worlds": worlds, "rounds": rounds}
    found = bench_integrators(beam, sphere, seconds=seconds, steps=steps, call=call, **how)
    if plot is not None:
        from otwarp.bench.integrators.figure import draw_integrators

        draw_integrators([found], plot)
    kind = "cpu" if place.is_cpu else "cuda"
    data = {"integrators": found.json()}
    return Section(name="integrators", kind=kind, machine=Machine.look(place), tables=page_tables(found), data=data)


def page_tables(found: IntegratorsBench) -> list[Table]:
    """For the page: what the command prints, under other titles and with how to read it."""
    titles = ("Time to 1 %", "Errors of the integrators", "Force models and precisions, default integrator and step")
    notes = (HOW_TO_READ, caption(found), "Errors in per cent.")
    return [replace(t, title=title, note=note) for t, title, note in zip(tables(found), titles, notes, strict=False)]


if __name__ == "__main__":
    command(
        measure,
        "Error against run time of the integrators.",
        rounds=7,
        seconds={"type": float, "default": SECONDS, "help": f"budget of the errors (default: {SECONDS:g})"},
        plot={"type": Path, "metavar": "PNG", "help": "draw the figure"},
    )
