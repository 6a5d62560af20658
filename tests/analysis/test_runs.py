"""Recorded runs: what is read of them, and what `otwarp analyse` says, on small runs of the simulator itself."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import otwarp as ot
from otwarp.analysis import (
    calibrate,
    crooks,
    drag_calibration,
    escape_rates,
    harmonic_tracks,
    jarzynski,
    load_trajectory,
    work,
)
from otwarp.analysis.trajectory import rotation_vectors
from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.files import ENOUGH
from tests.analysis.truth import DRAG, RELAXATION, TEMPERATURE, THERMAL
from tests.full_disk import largest_file

BEAD = Path(__file__).parents[2] / "scenes" / "single_bead.usda"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, device: str) -> Path:
    """16 worlds of the shipped bead for a second."""
    from otwarp.record import record_run

    folder = tmp_path_factory.mktemp("analyse") / "bead"
    record_run(ot.Scene.load(BEAD), folder, worlds=16, device=device, frames_per_second=61.0)
    return folder


@pytest.mark.thorough
def test_the_simulator_is_calibrated(run: Path) -> None:
    """Stiffness within 5 standard errors of the scene's, by every method; and what the file knows, to rounding."""
    bead = load_trajectory(run)
    assert bead.attrs["temperature"] == 298.15 and bead.attrs["drag"] == pytest.approx(6.0 * np.pi * 0.89e-3)
    found = ot.analysis.calibrate(bead)
    truth = np.array([1.036, 1.036, 0.5544])
    assert found["known_stiffness"].values == pytest.approx(truth, rel=1e-4)
    error = (found["stiffness_high"] - found["stiffness_low"]).values / (2.0 * 1.96)
    assert np.all(np.abs(found["stiffness"].values - truth) < 5.0 * error)
    slow = found["drag"].values[1:]
    error = (found["drag_high"] - found["drag_low"]).values[1:] / (2.0 * 1.96)
    assert np.all(np.abs(slow - bead.attrs["drag"]) < 5.0 * error)


@pytest.mark.thorough
def test_no_room_for_the_picture(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A disk that is full: one line, exit code 2, no remains."""
    for name in ("calib.png", "calib.pdf"):
        with largest_file(ENOUGH):
            assert main(["analyse", str(run / "run.nc"), "--psd", "--plot", str(tmp_path / name)]) == 2
        said = capsys.readouterr().err
        assert f"{name}: File too large; allowed: a disk with room" in said and said.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.thorough
def test_the_command_says_the_same(run: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "calib.png"
    words = ["analyse", str(run / "run.nc"), "--psd", "--msd", "--acf", "--calibrate", "--escapes", "--axis", "x"]
    assert main([*words, "--json", "--plot", str(picture)]) == 0
    said = json.loads(capfd.readouterr().out)
    rows = {row["estimator"]: row for row in said["calibration"]}
    expected = calibrate(load_trajectory(run).sel(axis=["x"]))
    for name, row in rows.items():
        assert row["stiffness"] == pytest.approx(float(expected["stiffness"].sel(estimator=name, axis="x")))
    assert set(rows) == set(expected["estimator"].values) and picture.read_bytes()[:4] == b"\x89PNG"
    assert said["escapes"][0]["events"] == 0 and said["escapes"][0]["exposure"] == pytest.approx(16.0)
    assert main(words) == 0
    out = capfd.readouterr().out
    assert "in 16 worlds; 298.15 K" in out and "the twin's own" in out


def test_what_cannot_be_analysed_is_said_in_one_line(
    run: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "note.nc").write_text("no run")
    cases = [
        ([str(tmp_path)], "run.nc: file = missing"),
        ([str(tmp_path / "note.nc")], "cannot be read"),
        ([str(run), "--body", "cell"], "body cell is none of the run"),
        ([str(run), "--world", "16"], "world is 16; allowed: 0 to 15"),
        ([str(run), "--until", "0.1"], "samples; allowed: 32"),
        ([str(run), "--drag"], "at rest"),
        ([str(run), "--work"], "do not move"),
        ([str(run), "--rotation"], "does not move"),
        ([str(run), "--axis", "w"], "--axis is w"),
        ([str(run), "--detector", "rate=7.7"], "detector: rate"),
        ([str(run), "--plot", str(tmp_path / "a.gif")], "--plot"),
    ]
    for words, expected in cases:
        assert main(["analyse", *words]) == 2
        out, error = capfd.readouterr()
        assert out == "" and error.count("\n") == 1 and expected in error, words
    assert [p.name for p in tmp_path.iterdir()] == ["note.nc"]


def moving(speed: float, samples: int, interval: float, worlds: int, seed: int) -> xr.Dataset:
    """Beads at 1 pN/µm whose trap begins to move at a speed [µm/s]: the lag of the mean is added to exact tracks."""
    x = harmonic_tracks([1.0], DRAG, interval, samples, tracks=worlds, temperature=TEMPERATURE, seed=seed)
    time = x["time"].values
    lag = DRAG * speed * (1.0 - np.exp(-time / RELAXATION))
    out = (x - lag[None, :, None]).to_dataset(name="displacement")
    trap = np.broadcast_to((speed * time)[None, :, None], x.shape)
    force = -out["displacement"].values
    done = np.cumsum(0.5 * (force[:, 1:] + force[:, :-1]) * np.diff(trap, axis=1), axis=1)[..., 0]
    out["trap_position"], out["trap_force"] = (x.dims, trap), (x.dims, force)
    out["trap_power"] = (x.dims[:2], np.ones(x.shape[:2]))
    out["work"] = (x.dims[:2], np.hstack([np.zeros((worlds, 1)), done]))
    return out.assign_attrs(drag=DRAG, temperature=TEMPERATURE, body="bead")


def test_drag_on_a_moving_trap() -> None:
    """300 runs: 95 % intervals hold the stiffness, by 5 σ."""
    runs = moving(20.0, 500, RELAXATION / 8, 300, 5)
    inside = []
    for world in range(0, 300, 3):
        found = drag_calibration(runs.isel(world=[world]))
        inside.append(float(found["stiffness_low"][0]) <= 1.0 <= float(found["stiffness_high"][0]))
    assert np.mean(inside) >= 0.95 - 5.0 * np.sqrt(0.95 * 0.05 / len(inside))
    both = drag_calibration(runs)
    assert float(both["stiffness"][0]) == pytest.approx(1.0, rel=0.01)


def test_work_obeys_jarzynski_and_crooks() -> None:
    """A trap that only moves: ΔF = 0. The mean work is γ·v²·(t − τ·(1 − e^(−t/τ))), its variance twice that in k_BT."""
    speed, interval, samples, worlds = 1.5, RELAXATION / 20, 120, 4000
    done = work(moving(speed, samples, interval, worlds, 7)).values
    time = interval * (samples - 1)
    mean = DRAG * speed**2 * (time - RELAXATION * (1.0 - np.exp(-time / RELAXATION)))
    error = np.sqrt(2.0 * mean * THERMAL / worlds)
    assert abs(done.mean() - mean) < 5.0 * error
    assert done.var() == pytest.approx(2.0 * mean * THERMAL, rel=5.0 * np.sqrt(2.0 / worlds))
    found = jarzynski(done, temperature=TEMPERATURE, level=0.9999)
    for name in ("free_energy", "cumulant"):
        assert float(found[f"{name}_low"]) < 0.0 < float(found[f"{name}_high"])
        assert abs(float(found[name])) < 0.2 * THERMAL
    pair = crooks(done[:2000], done[2000:], temperature=TEMPERATURE, level=0.9999)
    assert float(pair["free_energy_low"]) < 0.0 < float(pair["free_energy_high"])
    assert float(pair["slope_low"]) < 1.0 < float(pair["slope_high"])
    assert float(pair["slope_high"]) - float(pair["slope_low"]) < 1.0


def test_a_violent_pull_says_that_it_says_little() -> None:
    done = work(moving(8.0, 120, RELAXATION / 20, 50, 3)).values
    found = jarzynski(done, temperature=TEMPERATURE)
    assert float(found["rare"]) > 0.2 and float(found["free_energy_low"]) == -np.inf
    with pytest.raises(InputError, match="overlap"):
        crooks(done, done, temperature=TEMPERATURE)
    with pytest.raises(InputError, match="10 or more"):
        jarzynski(done[:5], temperature=TEMPERATURE)


def test_rates_of_escapes_are_garwoods() -> None:
    """3 events in 2 s: 0.619 to 8.767 events by his table; none in 2 s: up to 3.689."""
    found = escape_rates([3, 0], [2.0, 2.0])
    assert found["rate_low"].values * 2.0 == pytest.approx([0.6187, 0.0], abs=1e-4)
    assert found["rate_high"].values * 2.0 == pytest.approx([8.7673, 3.6889], abs=1e-4)


def test_rotation_vectors_about_the_mean() -> None:
    from scipy.spatial.transform import Rotation

    base = Rotation.from_rotvec([0.3, -1.0, 2.0])
    small = np.array([[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.02, 0.05], [0.0, -0.02, -0.05]])
    q = (Rotation.from_rotvec(small) * base).as_quat() * np.array([1.0, -1.0, 1.0, 1.0])[:, None]
    assert rotation_vectors(q) == pytest.approx(small, abs=1e-3)
