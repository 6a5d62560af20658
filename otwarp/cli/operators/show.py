"""`otwarp operators show`: print or draw what simulated operators have done."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli.options import json_option
from otwarp.cli.output import json_text, tables_console
from otwarp.cli.types import FILE, OutputPath


@click.command()
@click.argument("folder", type=FILE)
@click.option("--plot", type=OutputPath(), metavar="FILE", help="Draw into FILE: .png, .svg or .pdf.")
@json_option
def show(folder: Path, plot: Path | None, as_json: bool) -> None:
    """Print what the SIMULATED operators in FOLDER have done, beside the paper and meta-analyses, or draw it."""
    from otwarp.operators.folder import open_folder
    from otwarp.operators.summary import summarise

    found = open_folder(folder)
    if plot is not None:
        from otwarp.operators.figure import draw

        draw(found, plot)
        click.echo(f"wrote {plot}", err=as_json)
    if as_json:
        click.echo(json_text(summarise(found)))
    elif plot is None:
        _print(summarise(found))


def _print(found: dict[str, Any]) -> None:
    """Tables of a summary."""
    from rich.table import Table

    from otwarp.operators.summary import FELT, MEASURES
    from otwarp.operators.tables import comparison_lines, sobol_lines

    console = tables_console(100)
    console.print(f"{found['operators']:,} SIMULATED operators, {found['scene']}, {found['mode']} chain, "
                  f"population {found['population sha256'][:12]}")  # fmt: skip
    conditions = list(found["success"])
    grid = Table(box=None)
    grid.add_column("simulated")
    for name in conditions:
        grid.add_column(name, justify="right")
    for said in next(iter(found["outcomes"].values())):
        grid.add_row(said, *(str(found["outcomes"][c][said]) for c in conditions))
    ends = (found["success"][c] for c in conditions)
    grid.add_row("success", *(f"{r['value']:.3f} [{r['low']:.3f}, {r['high']:.3f}]" for r in ends))
    for name, (meaning, unit) in {**MEASURES, **FELT}.items():
        rows = (found["numbers"][c][name] for c in conditions)
        grid.add_row(f"{meaning} [{unit}]", *(f"{r['mean']:.3g} ± {r['deviation'] or 0.0:.2g}" for r in rows))
    console.print(grid)
    for line in comparison_lines(found):
        console.print(line)
    for row in sobol_lines(found):
        console.print(row)
