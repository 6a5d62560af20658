"""`otwarp study export`: what a study has found as one netCDF file."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli.types import FILE, OutputPath


@click.command()
@click.argument("folder", type=FILE)
@click.option("-o", "--out", type=OutputPath(), metavar="FILE", help="A netCDF file; default: FOLDER.nc.")
def export(folder: Path, out: Path | None) -> None:
    """Write what the study in FOLDER has found as one netCDF file, with names, units and intervals."""
    from otwarp.errors import InputError
    from otwarp.files import written
    from otwarp.studies.results import table
    from otwarp.studies.store import open_store

    out = out or folder.with_suffix(".nc")
    if out.suffix != ".nc":
        raise InputError(f"--out is {out}; allowed: a file that ends with .nc")
    found = table(open_store(folder))
    with written(out) as part:
        found.to_netcdf(part, engine="netcdf4")
    click.echo(f"wrote {out}")
