"""The tables of `otwarp bench integrators`, as text in cells: for the terminal and for documentation."""

from __future__ import annotations

import math

from otwarp.bench.integrators.cases import PLAIN
from otwarp.bench.integrators.observables import OBSERVABLES, PANELS, SEEN, Mean, bound_of
from otwarp.bench.integrators.result import WANTED, IntegratorsBench, Line
from otwarp.bench.report import NOTHING, Table

BASELINE = "eulerMaruyama"

SUMMARY_HEAD = (
    "integrator",
    "ns per bead-step",
    "of the default",
    *(f"z at 1 %: {panel}" for panel in PANELS),
    "ns per relaxation time at 1 %, all three",
    "Euler–Maruyama takes",
    "… without crossings",
)

VARIANTS_HEAD = ("force model or precision", "ns per bead-step", "of the default", "z", *OBSERVABLES.values())


def tables(bench: IntegratorsBench) -> list[Table]:
    """The integrators, their errors step by step, and force models and precisions if they were measured."""
    out = [
        Table(title=f"Integrators on {bench.hardware}", head=SUMMARY_HEAD, rows=summary_rows(bench)),
        Table(title="Their errors", head=error_head(bench), rows=error_rows(bench), note=caption(bench)),
    ]
    variants = variant_rows(bench)
    if variants:
        title = "Force models and precisions with the default integrator and step"
        out.append(Table(title=title, head=VARIANTS_HEAD, rows=variants))
    return out


def error_cell(found: Mean | None) -> str:
    """An error in per cent with its standard error, or a bound."""
    if found is None or not math.isfinite(found.value):
        return NOTHING
    size, bound = bound_of(found)
    return f"< {100.0 * size:.2g}" if bound else f"{100.0 * found.value:+.2f} ± {100.0 * found.error:.2g}"


def summary_rows(bench: IntegratorsBench) -> list[tuple[str, ...]]:
    """One row for every integrator: cost, largest steps, and time to 1 %."""
    lines = {line.name: line for line in bench.group("integrator") if line.limits}
    return [
        (
            line.label + (", default" if line.name == bench.default else ""),
            f"{line.cost.median:.4g}",
            line.ratio.text(),
            *(_step_cell(line, panel) for panel in PANELS),
            _time_cell(line),
            _times(lines.get(BASELINE), line),
            _times(lines.get(PLAIN), line),
        )
        for line in lines.values()
    ]


def _step_cell(line: Line, panel: str) -> str:
    limit = line.limits[panel]
    if limit.beyond:
        return f"> {limit.product:.2g}"
    return f"{limit.product:.2g} ({limit.low:.2g} – {limit.high:.2g})"


def _time_cell(line: Line) -> str:
    time, bound = line.time_to()
    return f"{'< ' if bound else ''}{time:.3g}"


def _times(slow: Line | None, line: Line) -> str:
    """How many times as long the other one takes."""
    if slow is None:
        return NOTHING
    (own, bound), (other, _) = line.time_to(), slow.time_to()
    return f"{'> ' if bound and slow is not line else ''}{other / own:.3g} ×"


def error_head(bench: IntegratorsBench) -> tuple[str, ...]:
    """Columns of `error_rows`: the steps."""
    products = sorted({p.product for line in bench.group("integrator") for p in line.points})
    return ("error [%]", *(f"z = {z:.3g}" for z in products))


def error_rows(bench: IntegratorsBench) -> list[tuple[str, ...]]:
    """A row for every integrator and panel, and a column for every step."""
    products = sorted({p.product for line in bench.group("integrator") for p in line.points})
    rows = []
    for panel in PANELS:
        for line in bench.group("integrator"):
            at = {p.product: p for p in line.points}
            cells = [error_cell(at[z].panel(panel)) if z in at else NOTHING for z in products]
            rows.append((f"{panel}, {line.label}", *cells))
    return rows


def variant_rows(bench: IntegratorsBench) -> list[tuple[str, ...]]:
    """A row for every force model and precision."""
    return [
        (
            line.label,
            f"{line.cost.median:.4g}",
            line.ratio.text(),
            f"{line.points[0].product:.3g}",
            *(error_cell(line.points[0].errors.get(name)) for name in OBSERVABLES),
        )
        for line in (*bench.group("force"), *bench.group("precision"))
    ]


def caption(bench: IntegratorsBench) -> str:
    """What was measured and how, in sentences."""
    clock = "processor time of one thread" if bench.kind == "cpu" else "wall time"
    deep, shallow = bench.powers
    across, half, along = bench.lags
    worst = max(e.error / e.value for of in bench.references.values() for e in of.values())
    return (
        f"One bead in a tabulated trap, {bench.bead()}; z = k·dt/γ in its stiffest direction. Variances ⟨x² + y²⟩ and "
        f"⟨δz²⟩, and correlations of x after {across} and of z after {half} and {along} relaxation times γ/k of that "
        f"direction, in a well of 20 k_BT ({deep:.3g} mW); mean escape time from 5 k_BT ({shallow:.3g} mW). Of a group "
        f"the worst is given. Errors are relative to the Fokker–Planck equation with the same force (of force models: "
        f"with the exact force), itself right to {100.0 * worst:.1g} %, with standard errors; below {SEEN:g} of them, "
        f"as bounds. Steps that are unstable at the rim of the sphere are left out. Time is {clock} of {bench.worlds} "
        f"beads, median (lower – upper quartile) of {bench.rounds} repeats in turns with the default. The step of "
        f"{100.0 * WANTED:g} % follows from the two leading orders of the error, fitted to all steps; in brackets, "
        f"68 %. By itself otwarp steps the default at z = {bench.default_product:.2g} here."
    )
