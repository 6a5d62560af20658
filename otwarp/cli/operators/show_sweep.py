"""What `otwarp operators show` makes of a sweep over delays and errors of perception."""

from __future__ import annotations

import click

from otwarp.cli.output import json_text, tables_console
from otwarp.operators.perception.export import plain
from otwarp.operators.perception.figure import LABELS
from otwarp.operators.perception.summary import AS_GOOD, MARGIN, UNTOLD, WORSE, WORSE_THAN_NONE, Maps

COLUMNS = {
    "success": ("delivered", "{:.2f}", 1.0),
    "lost": ("lost", "{:.2f}", 1.0),
    "success_minus_perfect": ("− no error", "{:+.2f}", 1.0),
    "success_minus_without": ("− no haptics", "{:+.2f}", 1.0),
    "contact_mean": ("contact pN", "{:.2f}", 1.0),
    "force_rmse_pn": ("error pN", "{:.2f}", 1.0),
    "force_r2": ("R²", "{:.2f}", 1.0),
    "direction_error": ("direction °", "{:.0f}", 1.0),
    "phase_1hz": ("phase ° 1 Hz", "{:.0f}", 1.0),
    "phase_5hz": ("5 Hz", "{:.0f}", 1.0),
    "sway": ("sway µm", "{:.0f}", 1e6),
    "limit_cycles": ("cycles", "{:.2f}", 1.0),
}
"""Columns of the table: heading, form, factor."""
WORDS = {AS_GOOD: "as good", WORSE: "fewer", WORSE_THAN_NONE: "fewer than without", UNTOLD: "not told"}
"""Verdicts in a column."""
ROWS = 100
"""Cells that are printed, at most: a map of 11 delays and 7 errors has 77."""


def print_sweep(found: Maps, *, as_json: bool) -> None:
    """Print a sweep as a table of its cells, or as JSON."""
    if as_json:
        click.echo(json_text(plain(found)))
        return
    from rich.table import Table

    console = tables_console(180)
    asked = found.asked
    console.print(
        f"{found.operators:,} SIMULATED operators of {asked['operators']:,} in every cell, {asked['scene']['file']}, "
        f"{asked['mode']} chain, force gain {asked['force gain']:g} N/pN, population {asked['population'][:12]}"
    )
    wide = [name for name, values in found.axes.items() if len(values) > 1] or ["delay"]
    columns = [name for name in COLUMNS if name in found.maps]
    grid = Table(box=None)
    for heading in [LABELS[name][0] for name in wide] + [COLUMNS[name][0] for name in columns]:
        grid.add_column(heading, justify="right", no_wrap=True)
    grid.add_column("deliveries are", no_wrap=True)
    for said, row in found.beside.items():
        name = {"without": "no haptics", "perfect": "no error"}[said]
        grid.add_row(name, *[""] * (len(wide) - 1), *(_cell(row.get(c), c) for c in columns), "")
    rows = plain(found)["cells"]
    for row in rows[:ROWS]:
        at = (f"{row[name] * LABELS[name][1]:g}" for name in wide)
        grid.add_row(*at, *(_cell(row[c], c) for c in columns), WORDS[row["verdict success"]])
    console.print(grid)
    console.print(
        f"as good: at most {MARGIN['success']:g} fewer than without error, by intervals of 95 %; not told: "
        f"{found.operators:,} operators leave it open"
    )
    if len(rows) > ROWS:
        console.print(f"and {len(rows) - ROWS} cells more: --json has all")


def _cell(value: float | None, name: str) -> str:
    """A number of a column."""
    _, form, factor = COLUMNS[name]
    return "" if value is None or value != value else form.format(value * factor)
