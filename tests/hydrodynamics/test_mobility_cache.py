"""The mobility on disk: found, believed only if intact, never in the way."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp import cache
from otwarp.hydrodynamics import body_mobility, mobility_cache
from otwarp.hydrodynamics.mobility import _refined

CENTRES, RADII = np.array([[0.0, 0, 0], [1.5, 0, 0], [0, 1.2, 0]]), np.array([1.0, 0.8, 0.5])
NO_RODS = (np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
ACCURACY = 0.2


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("OTWARP_CACHE", str(tmp_path / "cache"))
    _refined.cache_clear()
    yield tmp_path / "cache"
    _refined.cache_clear()


def again():
    """As another process would: nothing is in memory."""
    _refined.cache_clear()
    return body_mobility(CENTRES, RADII, accuracy=ACCURACY)


def never(*_):
    raise AssertionError("computed anew")


def test_second_time_comes_from_disk(folder, monkeypatch):
    first = again()
    assert len(list(folder.glob("*.npz"))) == 1
    monkeypatch.setattr("otwarp.hydrodynamics.blobs.assembly_mobility", never)
    second = again()
    for name in ("reference", "mobility", "resistance", "cholesky", "flow_coupling"):
        np.testing.assert_array_equal(getattr(second, name), getattr(first, name))
        assert not getattr(second, name).flags.writeable
    assert (second.error, second.blobs) == (first.error, first.blobs)
    assert not list(folder.glob("*.part"))


@pytest.mark.parametrize(
    "change",
    [
        lambda: body_mobility(CENTRES + 0.1, RADII, accuracy=ACCURACY),
        lambda: body_mobility(CENTRES, RADII * 1.01, accuracy=ACCURACY),
        lambda: body_mobility(CENTRES, RADII, accuracy=0.19),
        lambda: body_mobility(CENTRES, RADII, rods=(CENTRES[1:2], CENTRES[2:], RADII[:1]), accuracy=ACCURACY),
    ],
    ids=["centres", "radii", "accuracy", "rods"],
)
def test_anything_else_is_another_file(folder, change):
    again()
    change()
    assert len(list(folder.glob("*.npz"))) == 2


def test_another_version_is_another_file(folder, monkeypatch):
    again()
    monkeypatch.setattr(mobility_cache, "VERSION", mobility_cache.VERSION + 1)
    again()
    assert len(list(folder.glob("*.npz"))) == 2


@pytest.mark.parametrize("damage", ["cut", "empty", "flipped", "foreign", "shapes"])
def test_damaged_file_is_built_anew(folder, damage):
    first = again()
    path = next(folder.glob("*.npz"))
    whole = path.read_bytes()
    if damage == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "empty":
        path.write_bytes(b"")
    elif damage == "flipped":
        middle = len(whole) // 2
        path.write_bytes(whole[:middle] + bytes([whole[middle] ^ 0xFF]) + whole[middle + 1 :])
    elif damage == "foreign":
        path.write_bytes(b"PK\x03\x04 something else")
    else:  # intact, but not what this version writes
        about = mobility_cache.describe(CENTRES, RADII, NO_RODS, ACCURACY)
        cache.save(folder, about, {"reference": np.zeros(2), "mobility": np.eye(6)})
    np.testing.assert_array_equal(again().mobility, first.mobility)
    assert path.read_bytes() == whole


def test_no_cache_and_no_folder(folder, tmp_path, monkeypatch):
    body_mobility(CENTRES, RADII, accuracy=ACCURACY, cache=False)
    assert not folder.exists()
    body_mobility(CENTRES, RADII, accuracy=ACCURACY, cache=tmp_path / "other")
    assert len(list((tmp_path / "other").glob("*.npz"))) == 1
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    monkeypatch.setenv("OTWARP_CACHE", str(blocked / "folder"))
    assert again().blobs > 0


def test_lone_spheres_and_pair_mobilities_need_no_disk(folder):
    body_mobility(CENTRES[:1], RADII[:1], accuracy=0.01)
    body_mobility(CENTRES, RADII)
    assert not folder.exists()
