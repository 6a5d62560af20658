from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from otwarp.record.monitor import Monitor
from otwarp.record.netcdf import QUANTITIES, NetcdfRecording
from otwarp.scene import Scene
from tests.record.small_run import HELD, RATE, frame

SINGLE = 6.1e-8
"""Relative rounding of single precision, in which the frames are stored."""


def open_file(scene: Scene, path: Path, worlds: int, total: int) -> NetcdfRecording:
    monitor = Monitor(scene, HELD, total)
    options = {"total_worlds": total, "seed": 2**32 - 1, "time_step": 1e-4, "frames_per_second": RATE}
    return NetcdfRecording(path, scene, monitor, worlds=worlds, **options)


def test_xarray_reads_back_what_was_written(scene: Scene, tmp_path: Path) -> None:
    recording = open_file(scene, tmp_path / "run.nc", 2, 5)
    frames = [frame(scene, i, worlds=5) for i in range(7)]
    for item in frames:
        recording.write(item)
    recording.close()
    with xr.open_dataset(tmp_path / "run.nc") as data:
        assert dict(data.sizes) == {"frame": 7, "world": 2, "body": 6, "trap": 2, "xyz": 3, "quaternion": 4}
        assert list(data["body"].values) == [b.name for b in scene.bodies]
        assert list(data["trap"].values) == [t.prim for t in scene.traps]
        assert list(data["quaternion"].values) == ["x", "y", "z", "w"]
        np.testing.assert_array_equal(data["time"].values, [f.time for f in frames])
        np.testing.assert_array_equal(data["step"].values, [f.step for f in frames])
        assert data["time"].attrs["units"] == "s"
        for name in QUANTITIES:
            wanted = np.stack([getattr(f, name)[:2] for f in frames])
            np.testing.assert_allclose(data[name].values, wanted, rtol=SINGLE, atol=1e-12)
            assert "time" in data[name].coords
        for name, variable in data.variables.items():
            assert variable.attrs["units"], name
            assert variable.attrs["long_name"], name
        assert data.attrs["Conventions"].startswith("CF-")
        assert (data.attrs["scene"], data.attrs["seed"], data.attrs["time_step"]) == ("small", 2**32 - 1, 1e-4)
        force = data["contact_force"].sel(body="/World/Group/left", world=1, xyz="x")
        np.testing.assert_allclose(force, [-1.0 - f.time for f in frames], rtol=SINGLE)


def test_a_file_that_is_being_written_is_whole_after_every_frame(scene: Scene, tmp_path: Path) -> None:
    recording = open_file(scene, tmp_path / "run.nc", 1, 1)
    for index in range(3):
        recording.write(frame(scene, index))
        with xr.open_dataset(tmp_path / "run.nc") as data:
            assert data.sizes["frame"] == index + 1
            assert float(data["time"][-1]) == index / RATE
    recording.close()
    assert [p.name for p in tmp_path.glob("*.nc*")] == ["run.nc"]


def test_what_a_scene_lacks_is_left_out(scene: Scene, tmp_path: Path) -> None:
    import dataclasses

    bare = dataclasses.replace(scene, traps=(), goal=None)
    options = {"total_worlds": 1, "seed": 0, "time_step": 1e-4, "frames_per_second": RATE}
    recording = NetcdfRecording(tmp_path / "run.nc", bare, Monitor(bare, (), 1), worlds=1, **options)
    recording.write(frame(bare, 0))
    recording.close()
    with xr.open_dataset(tmp_path / "run.nc") as data:
        assert "trap" not in data.sizes
        assert not [name for name in data.variables if str(name).startswith("trap")]
        assert data.sizes["frame"] == 1


def test_unwrapped_positions_where_space_repeats(scene: Scene, tmp_path: Path) -> None:
    """In float64: 1e6 µm and a nanometre."""
    import dataclasses

    endless = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, period=(50.0, 0.0, 0.0)))
    recording = open_file(endless, tmp_path / "run.nc", 1, 2)
    far = np.random.default_rng(0).uniform(-1e6, 1e6, (2, 6, 3))
    recording.write(dataclasses.replace(frame(scene, 0, worlds=2), unwrapped=far))
    recording.close()
    with xr.open_dataset(tmp_path / "run.nc") as data:
        assert data["unwrapped"].dims == ("frame", "world", "body", "xyz")
        np.testing.assert_array_equal(data["unwrapped"].values, far[None, :1])


def test_entries_at_an_inlet(scene: Scene, tmp_path: Path) -> None:
    import dataclasses

    settings = dataclasses.replace(scene.settings, domain_low=(-50.0, 0.0, 0.0), domain_high=(50.0, 0.0, 0.0))
    recording = open_file(dataclasses.replace(scene, settings=settings), tmp_path / "run.nc", 1, 2)
    entries = np.arange(12, dtype=np.int32).reshape(2, 6)
    recording.write(dataclasses.replace(frame(scene, 0, worlds=2), entries=entries))
    recording.close()
    with xr.open_dataset(tmp_path / "run.nc") as data:
        assert data["entries"].dims == ("frame", "world", "body")
        np.testing.assert_array_equal(data["entries"].values, entries[None, :1])


def test_distances_of_traps_that_hold_nothing_are_nan(scene: Scene, tmp_path: Path) -> None:
    recording = open_file(scene, tmp_path / "run.nc", 1, 1)
    recording.write(frame(scene, 0, trap_distance=np.array([[np.nan, 0.5]])))
    recording.close()
    with xr.open_dataset(tmp_path / "run.nc") as data:
        np.testing.assert_array_equal(data["trap_distance"][0, 0], [np.nan, 0.5])


@pytest.mark.parametrize("engine", ["scipy", "netcdf4"])
def test_the_format_is_the_one_that_every_reader_knows(scene: Scene, tmp_path: Path, engine: str) -> None:
    recording = open_file(scene, tmp_path / "run.nc", 1, 1)
    recording.write(frame(scene, 0))
    recording.close()
    assert (tmp_path / "run.nc").read_bytes()[:4] == b"CDF\x02"
    with xr.open_dataset(tmp_path / "run.nc", engine=engine) as data:
        assert data.sizes["frame"] == 1
