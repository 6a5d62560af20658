"""`otwarp study show`: print or draw what a study has found."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli.options import json_option
from otwarp.cli.output import json_text, tables_console
from otwarp.cli.types import FILE, OutputPath

ROWS = 40
"""Points that are printed, at most."""


@click.command()
@click.argument("folder", type=FILE)
@click.option("--plot", type=OutputPath(), metavar="FILE", help="Draw into FILE: .png, .svg or .pdf.")
@click.option("--observable", metavar="NAME", help="What is drawn; default: the first.")
@json_option
def show(folder: Path, plot: Path | None, observable: str | None, as_json: bool) -> None:
    """Print what the study in FOLDER has found, or draw it."""
    from otwarp.errors import InputError
    from otwarp.studies.results import table
    from otwarp.studies.store import open_store

    if observable is not None and plot is None:
        raise InputError(f"--observable is {observable}; allowed with --plot alone: all are printed")
    store = open_store(folder)
    if plot is not None:
        from otwarp.studies.figure import draw

        click.echo(f"wrote {draw(store, plot, name=observable)}")
        return
    found = table(store)
    frame = found.to_dataframe().reset_index() if found.sizes else found.expand_dims("point").to_dataframe()
    if as_json:
        click.echo(
            json_text([{k: (None if v != v else v) for k, v in row.items()} for row in frame.to_dict("records")])
        )
        return
    from rich.table import Table

    grid = Table(box=None)
    shown = [c for c in frame.columns if not c.endswith(("_count", "_exposure"))]
    for name in shown:
        grid.add_column(name, justify="right")
    for row in frame.head(ROWS)[shown].itertuples(index=False):
        grid.add_row(*(f"{v:.4g}" if isinstance(v, float) else str(v) for v in row))
    tables_console(60 + 14 * len(shown)).print(grid)
    if len(frame) > ROWS:
        click.echo(f"… {len(frame) - ROWS:,} more; all of them: otwarp study export {folder} -o FILE.nc")
