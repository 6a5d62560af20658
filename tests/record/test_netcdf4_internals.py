"""The insides of netCDF4 that the recording counts on are there, and do what they are used for."""

from __future__ import annotations

import gc

import netCDF4

from otwarp.record.netcdf4_internals import abandon


def test_an_abandoned_file_counts_as_closed_and_is_left_alone(tmp_path):
    path = tmp_path / "run.nc"
    file = netCDF4.Dataset(path, "w", format="NETCDF3_64BIT_OFFSET")
    file.createDimension("frame", None)
    file.createVariable("time", "f8", ("frame",))[0] = 1.0
    file.sync()
    before = path.read_bytes()
    assert file.isopen()
    assert file._isopen == 1
    abandon(file)
    assert not file.isopen()
    del file
    gc.collect()
    assert path.read_bytes() == before
