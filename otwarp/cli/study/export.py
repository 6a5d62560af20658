"""`otwarp study export`: what a study has found as one netCDF file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli.types import FILE, OutputPath


@click.command()
@click.argument("folder", type=FILE)
@click.option("-o", "--out", type=OutputPath(), metavar="FILE", help="A netCDF file; default: FOLDER.nc.")
def export(folder: Path, out: Path | None) -> None:
    """Write what the study in FOLDER has found as one netCDF file, with names, units and intervals."""
    from otwarp.cli.output import with_room
    from otwarp.errors import InputError
    from otwarp.files import written
    from otwarp.studies.results import table
    from otwarp.studies.store import open_store

    out = out or folder.with_suffix(".nc")
    if out.suffix != ".nc":
        raise InputError(f"--out is {out}; allowed: a file that ends with .nc")
    found = table(open_store(folder))
    image = _netcdf(found)
    with with_room(out), written(out) as part:
        part.write_bytes(image)
    click.echo(f"wrote {out}")


def _netcdf(found: Any) -> memoryview:
    """A table as netCDF-4, made in memory: after a write that fails, the library cannot close a file again."""
    import netCDF4
    from xarray.backends import NetCDF4DataStore

    file = netCDF4.Dataset("table.nc", "w", format="NETCDF4", memory=0)
    found.dump_to_store(NetCDF4DataStore(file))
    return file.close()
