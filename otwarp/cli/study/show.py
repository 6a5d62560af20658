"""`otwarp study show`: print or draw what a study has found."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli.options import json_option
from otwarp.cli.output import json_text, tables_console, with_room
from otwarp.cli.types import FILE, Number, OutputPath

ROWS = 40
"""Points that are printed, at most."""


@click.command()
@click.argument("folder", type=FILE)
@click.option("--plot", type=OutputPath(), metavar="FILE", help="Draw into FILE: .png, .svg or .pdf.")
@click.option("--observable", metavar="NAME", help="What is drawn; default: what was searched, or the first.")
@click.option(
    "--contour",
    type=Number(0.0, 1.0, above=True),
    metavar="P",
    help="Print where a probability is P on a map, with the lines it lies between; with --plot, draw that. [P 0.5]",
)
@json_option
def show(folder: Path, plot: Path | None, observable: str | None, contour: float | None, as_json: bool) -> None:
    """Print what the study in FOLDER has found, or draw it."""
    from otwarp.errors import InputError
    from otwarp.studies.contours import contour_lines
    from otwarp.studies.rare.results import SHOWN
    from otwarp.studies.results import table
    from otwarp.studies.store import open_store

    if observable is not None and plot is None and contour is None:
        raise InputError(f"--observable is {observable}; allowed with --plot or --contour: all are printed")
    store = open_store(folder)
    if plot is not None:
        from otwarp.studies.figure import draw

        with with_room(plot):
            draw(store, plot, name=observable, level=contour or 0.5)
        click.echo(f"wrote {plot}")
        return
    found = table(store)
    if contour is not None:
        found = contour_lines(found, observable or store.asked()["observables"][0]["name"], contour)
    flat = found.drop_dims([d for d in ("interface",) if d in found.sizes])  # lists of escapes
    frame = flat.to_dataframe().reset_index() if flat.sizes else flat.expand_dims("point").to_dataframe()
    if as_json:
        rows = [{k: (None if v != v else v) for k, v in row.items()} for row in frame.to_dict("records")]
        for name in (n for n in found.data_vars if n not in flat):
            lists = found[name].values.reshape(len(rows), -1)
            for row, values in zip(rows, lists, strict=True):
                row[str(name)] = [float(v) for v in values if v == v]
        click.echo(json_text(rows))
        return
    from rich.table import Table

    grid = Table(box=None)
    shown = [c for c in frame.columns if not c.endswith(("_count", "_exposure"))]
    if "escape_rate" in flat:
        shown = [c for c in frame.columns if c in flat.coords or c in SHOWN]
    for name in shown:
        grid.add_column(name, justify="right")
    for row in frame.head(ROWS)[shown].itertuples(index=False):
        grid.add_row(*(f"{v:.4g}" if isinstance(v, float) else str(v) for v in row))
    tables_console(60 + 14 * len(shown)).print(grid)
    if len(frame) > ROWS:
        click.echo(f"… {len(frame) - ROWS:,} more; all of them: otwarp study export {folder} -o FILE.nc")
