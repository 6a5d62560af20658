"""What is said of a trajectory that is not stationary, and what is not said of one that is."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from otwarp.analysis import calibrate, harmonic_tracks
from otwarp.analysis.stationary import not_stationary
from otwarp.cli.analyse import _misses
from otwarp.errors import PlausibilityWarning
from tests.analysis.truth import DRAG, RELAXATION, TEMPERATURE

INTERVAL = RELAXATION / 8


def tracks(worlds: int, seed: int = 3) -> xr.Dataset:
    """Exact tracks at 1 pN/µm, 120 relaxation times long."""
    options = {"tracks": worlds, "temperature": TEMPERATURE, "seed": seed}
    x = harmonic_tracks([1.0, 1.0], DRAG, INTERVAL, 960, **options)
    return x.to_dataset(name="displacement").assign_attrs(temperature=TEMPERATURE, body="bead")


@pytest.mark.parametrize("worlds", [1, 8])
def test_a_stationary_track_has_nothing_said_of_it(worlds: int) -> None:
    """200 tracks of two axes and three lengths of blocks at 5 σ: none in 1,200 tests."""
    assert not [seed for seed in range(100) if not_stationary(tracks(worlds, seed))]


def test_a_beginning_that_settles_is_left_out() -> None:
    """It begins 0.3 µm off, five thermal deviations, and relaxes: what is left after --from T is quiet."""
    bead = tracks(8)
    off = 0.3 * np.exp(-bead["time"] / RELAXATION)
    bead["displacement"] = bead["displacement"] + off * xr.DataArray([1.0, 0.0], dims="axis")
    with pytest.warns(PlausibilityWarning, match="bead: the beginning has not settled: .* along x, .* --from"):
        found = calibrate(bead, methods=["equipartition"])
    after = float(found.attrs["warnings"].rsplit(" ", 1)[1])
    assert RELAXATION < after < 12 * RELAXATION
    assert not not_stationary(bead.sel(time=slice(after, None)))


def test_traps_that_move_or_change_are_said() -> None:
    bead = tracks(2)
    still = xr.zeros_like(bead["displacement"]).rename(axis="xyz").drop_vars("xyz", errors="ignore")
    still = xr.concat([still, still.isel(xyz=[0])], "xyz").expand_dims(trap=2).copy()
    steady = xr.ones_like(bead["displacement"].isel(axis=0, drop=True))
    assert not not_stationary(bead.assign(foci=still, trap_power=steady))
    moved = still.copy()
    moved[1, 0, 500:, 2] = 2.5  # the other trap, along z
    assert "by 2.5 µm along z" in not_stationary(bead.assign(foci=moved))[0]
    drifting = bead.assign(trap_position=bead["displacement"] * 0.0 + 3.0 * bead["time"] / bead["time"].max())
    assert "by 3 µm along x, 3 µm along y" in not_stationary(drifting)[0]
    assert "power" in not_stationary(bead.assign(foci=still, trap_power=steady * (1.0 + bead["time"])))[0]


def test_an_interval_that_misses_what_is_known() -> None:
    row = xr.Dataset({"stiffness": 1.0, "stiffness_low": 0.9, "stiffness_high": 1.1})
    assert _misses(row, "stiffness", 1.2) and not _misses(row, "stiffness", 1.05)
    assert not _misses(row, "stiffness", float("nan")) and not _misses(row, "drag", 1.2)
