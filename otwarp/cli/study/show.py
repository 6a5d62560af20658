"""`otwarp study show`: print or draw what a study has found."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from otwarp.cli.options import json_option
from otwarp.cli.output import json_text, tables_console, with_room
from otwarp.cli.types import FILE, Number, OutputPath
from otwarp.errors import InputError

ROWS = 40
"""Points that are printed, at most."""


class At(click.ParamType):
    """An axis and a value of it, as trap_power=0.5."""

    name = "axis=value"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read it.

        Raises:
            InputError: No such pair, or no finite number.
        """
        name, _, number = str(value).rpartition("=")
        try:
            if name and math.isfinite(float(number)):
                return name, float(number)
        except ValueError:
            pass
        raise InputError(f"--at is {value}; allowed: an axis and a number in its unit, as trap_power=0.5")


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
@click.option("--survival", is_flag=True, help="Draw how many trials go on, over time, at points along one axis.")
@click.option(
    "--at", type=At(), multiple=True, metavar="AXIS=VALUE", help="What is drawn of an axis: the nearest value."
)
@json_option
def show(folder: Path, plot: Path | None, observable: str | None, contour: float | None, **how: Any) -> None:
    """Print what the study in FOLDER has found, or draw it."""
    import numpy as np

    from otwarp.studies.contours import contour_lines
    from otwarp.studies.results import table
    from otwarp.studies.store import open_store

    if observable is not None and plot is None and contour is None:
        raise InputError(f"--observable is {observable}; allowed with --plot or --contour: all are printed")
    for name in ("survival", "at"):
        if how[name] and plot is None:
            raise InputError(f"--{name}; allowed with --plot")
    names = [name for name, _ in how["at"]]
    again = next((name for name in names if names.count(name) > 1), None)
    if again is not None:
        raise InputError(f"--at {again} is given {names.count(again)} times; allowed: once for each axis")
    store = open_store(folder)
    if plot is not None:
        from otwarp.studies.figure import draw

        with with_room(plot):
            draw(store, plot, name=observable, level=contour, survival=how["survival"], at=dict(how["at"]))
        click.echo(f"wrote {plot}", err=how["as_json"])
        if not how["as_json"]:
            return
    found = table(store)
    if contour is not None and plot is None:
        if not np.any(found["trials"].values):
            raise InputError(f"{store.folder}: no point is computed yet; allowed: a study that has run")
        kinds = {o["name"]: o["kind"] for o in store.asked()["observables"]}
        name = observable or next((n for n, kind in kinds.items() if kind == "probability"), next(iter(kinds)))
        lines = contour_lines(found, name, contour)
        if not how["as_json"] and "estimate" not in lines["through"].values:
            ends = [float(v(found[name])) for v in (np.nanmin, np.nanmax)]
            click.echo(f"no contour: P({name}) is {ends[0]:.4g} to {ends[1]:.4g} on this map, nowhere {contour:g}")
        found = lines
    flat = found.drop_dims([d for d in ("interface",) if d in found.sizes])  # lists of escapes
    if how["as_json"]:
        click.echo(json_text(_rows(found, flat)))
        return
    looked = int(np.sum(flat["trials"].values > 0)) if "trials" in flat else 0
    if "largest" in flat:  # what was searched, not what was looked at on the way
        flat = flat[[n for n in flat.data_vars if str(n).startswith("largest")]]
    if not flat.sizes or any(flat.sizes.values()):
        _print(store.asked(), flat, folder)
    if "largest" in flat:
        click.echo(f"{looked:,} of {found['trials'].size:,} points were looked at; "
                   f"all of them: --json, or otwarp study export {folder} -o FILE.nc")  # fmt: skip


def _frame(flat: Any) -> Any:
    """A row for each point, in the order of the study's axes."""
    order = [*flat["trials"].dims] if "trials" in flat else None
    return flat.to_dataframe(order).reset_index() if flat.sizes else flat.expand_dims("point").to_dataframe()


def _rows(found: Any, flat: Any) -> list[dict[str, Any]]:
    """A table as rows, with its lists of interfaces."""
    rows = [{k: (None if v != v else v) for k, v in row.items()} for row in _frame(flat).to_dict("records")]
    for name in (n for n in found.data_vars if n not in flat):
        lists = found[name].values.reshape(len(rows), -1)
        for row, values in zip(rows, lists, strict=True):
            row[str(name)] = [float(v) for v in values if v == v]
    return rows


def _print(asked: dict[str, Any], flat: Any, folder: Path) -> None:
    """The first points of a table: where they are, what was found, and at last from how many trials."""
    from rich.table import Table
    from rich.text import Text

    from otwarp.cli.study.table import columns

    frame = _frame(flat)
    # a contour is no result of trials: all that it has are places
    shown = columns(asked, flat) if "trials" in flat or "largest" in flat else _all(frame, flat)
    grid = Table(box=None)
    for heading, _ in shown:
        grid.add_column(Text(heading), justify="right", no_wrap=True)
    rows = [[text(row) for _, text in shown] for row in frame.head(ROWS).to_dict("records")]
    for row in rows:
        grid.add_row(*row)
    widths = [max(map(len, (heading, *column))) for (heading, _), *column in zip(shown, *rows, strict=True)]
    tables_console(sum(widths) + 2 * len(widths)).print(grid)
    if len(frame) > ROWS:
        click.echo(f"… {len(frame) - ROWS:,} more; all of them: otwarp study export {folder} -o FILE.nc")


def _all(frame: Any, flat: Any) -> list[Any]:
    """A column for each of a table's."""
    from otwarp.cli.study.table import heading, plain

    return [(heading(flat, name) if name in flat else name, plain(name)) for name in frame.columns]
