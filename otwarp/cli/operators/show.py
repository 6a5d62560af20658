"""`otwarp operators show`: print or draw what simulated operators have done."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli.options import json_option
from otwarp.cli.output import json_text, tables_console
from otwarp.cli.types import FILE, Number, OutputPath
from otwarp.errors import InputError


class Named(click.ParamType):
    """A name and a number of micrometres."""

    name = "name=number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, float]:
        """Read them.

        Raises:
            InputError: No such pair.
        """
        name, _, number = str(value).rpartition("=")
        if not name:
            raise InputError(f"--network is {value}; allowed: NAME=µm, as small=0.3")
        return name, float(Number(0.0, 1000.0, unit="µm").convert(number, param, ctx))


@click.command()
@click.argument("folder", type=FILE)
@click.option("--plot", type=OutputPath(), metavar="FILE", help="Draw into FILE: .png, .svg or .pdf.")
@click.option("--export", type=OutputPath(), metavar="FILE.nc", help="Of a sweep: write its maps as netCDF.")
@click.option("--network", type=Named(), multiple=True, metavar="NAME=UM",
              help="Of a sweep: depth error of a network, drawn into the map.")  # fmt: skip
@click.option("--depth-range", type=Number(0.0, 1000.0, above=True, unit="µm"), metavar="UM",
              help="Of a sweep: of what the paper's depth errors are parts; default: 20, assumed.")  # fmt: skip
@json_option
def show(folder: Path, plot: Path | None, as_json: bool, **of_sweep: Any) -> None:
    """Print what the SIMULATED operators in FOLDER have done, beside the paper and meta-analyses, or draw it.

    Of a sweep: its cells, each against no error and no haptics, or maps of them.
    """
    from otwarp.operators.folder import open_folder
    from otwarp.operators.perception.folder import is_sweep
    from otwarp.operators.summary import summarise

    found = open_folder(folder)
    if is_sweep(found):
        _show_sweep(found, plot, as_json=as_json, **of_sweep)
        return
    given = [name for name, value in of_sweep.items() if value]
    if given:
        raise InputError(f"--{given[0].replace('_', '-')} of a study; allowed: of a sweep")
    if plot is not None:
        from otwarp.operators.figure import draw

        draw(found, plot)
        click.echo(f"wrote {plot}", err=as_json)
    if as_json:
        click.echo(json_text(summarise(found)))
    elif plot is None:
        _print(summarise(found))


def _show_sweep(
    folder: Any, plot: Path | None, *, as_json: bool, export: Path | None, network: Any, depth_range: float | None
) -> None:
    """Draw, write or print a sweep."""
    from otwarp.cli.operators.show_sweep import print_sweep
    from otwarp.operators.perception.export import export as write
    from otwarp.operators.perception.figure import DEPTH_RANGE, draw_maps
    from otwarp.operators.perception.summary import maps_of

    found = maps_of(folder)
    if plot is not None:
        assumed = depth_range or found.asked["perception"]["depth range"] or DEPTH_RANGE
        draw_maps(found, plot, networks=dict(network), depth_range=assumed)
        click.echo(f"wrote {plot}", err=as_json)
    if export is not None:
        write(found, export)
        click.echo(f"wrote {export}", err=as_json)
    if as_json or (plot is None and export is None):
        print_sweep(found, as_json=as_json)


def _print(found: dict[str, Any]) -> None:
    """Tables of a summary."""
    from rich.markup import escape  # units in brackets are no styles
    from rich.table import Table

    from otwarp.operators.summary import FELT, MEASURES
    from otwarp.operators.tables import comparison_lines, sobol_lines

    console = tables_console(100)
    console.print(f"{found['operators']:,} SIMULATED operators, {found['scene']}, {found['mode']} chain, "
                  f"population {found['population sha256'][:12]}")  # fmt: skip
    conditions = list(found["success"])
    grid = Table(box=None)
    grid.add_column("simulated", no_wrap=True)
    for name in conditions:
        grid.add_column(name, justify="right")
    for said in next(iter(found["outcomes"].values())):
        grid.add_row(said, *(str(found["outcomes"][c][said]) for c in conditions))
    ends = (found["success"][c] for c in conditions)
    grid.add_row("success", *(f"{r['value']:.3f} [{r['low']:.3f}, {r['high']:.3f}]" for r in ends))
    for name, (meaning, unit) in {**MEASURES, **FELT}.items():
        rows = (found["numbers"][c][name] for c in conditions)
        grid.add_row(escape(f"{meaning} [{unit}]"), *(f"{r['mean']:.3g} ± {r['deviation'] or 0.0:.2g}" for r in rows))
    console.print(grid)
    for line in (*comparison_lines(found), *sobol_lines(found)):
        console.print(line, markup=False)
