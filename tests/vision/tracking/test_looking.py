"""From the command line: a network is trained on a bead, follows it through a run, and finds three in one frame."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import chi2, norm

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.record import record_run
from otwarp.scene import Scene, SceneBuilder, Settings
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.tracking.finding import find
from otwarp.vision.tracking.looking import sightings

pytest.importorskip("torch")
pytest.importorskip("zarr")

BEAD = Path(__file__).parents[3] / "scenes" / "single_bead.usda"
TEXT = f"""
scene = "{BEAD}"
seed = 3
image = {{ width = 64 }}
tilts = {{ classes = [0] }}
depth = {{ from = -0.8, to = 0.8, count = 400, scattered = true }}
render = {{ rings = 2, thickness = 0.2 }}
domain = {{ x = {{ from = -0.4, to = 0.4 }}, y = {{ from = -0.4, to = 0.4 }} }}
splits = {{ random = [320, 40, 40] }}
"""
PLACES = np.array([(-6.0, -4.0, 10.3), (0.5, 5.0, 9.6), (6.2, -3.1, 10.0)])
"""Of three beads [µm]; the camera focuses at 10."""

SIGMAS = 5.0


@pytest.fixture(scope="module")
def net(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `net`, a training, and `robot.onnx`."""
    folder = tmp_path_factory.mktemp("bead")
    (folder / "bead.toml").write_text(TEXT)
    words = ["vision", "dataset", str(folder / "bead.toml"), "--out", str(folder / "set"), "--processes", "1"]
    assert main([*words, "--device", "cpu"]) == 0
    words = ["vision", "train", str(folder / "set"), "--net", "small", "--heads", "pose", "--epochs", "20", "--batch"]
    assert main([*words, "8", "--lr", "3e-3", "--out", str(folder / "net"), "--device", "cpu"]) == 0
    assert main(["vision", "export", str(folder / "net"), "--onnx", str(folder / "robot.onnx")]) == 0
    return folder


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three beads as the scene's own camera records them."""
    folder, scene = tmp_path_factory.mktemp("three"), Scene.load(BEAD)
    builder, bead = SceneBuilder(settings=Settings(duration=1.0)), scene.bodies[0]
    assert scene.camera is not None
    builder.add(scene.camera)
    for n, place in enumerate(PLACES):
        prim = f"/World/bead{n}"
        spheres = tuple(dataclasses.replace(s, prim=f"{prim}/sphere") for s in bead.spheres)
        builder.add(dataclasses.replace(bead, prim=prim, position=tuple(place), spheres=spheres))
    builder.save(folder / "three.usda")
    words = ["vision", "render", str(folder / "three.usda"), "--size", "320x256", "--rings", "2", "--thickness", "0.2"]
    assert main([*words, "-o", str(folder / "three.tif"), "--device", "cpu"]) == 0
    return folder / "three.tif"


@pytest.mark.parametrize("kind", ["net", "robot.onnx"])
def test_a_network_follows_a_run(net: Path, kind: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Errors are a fraction of the thermal motion, and those that are stated are right as far as one run can tell.

    A network errs alike wherever the bead looks alike: its errors in a run are one draw of three numbers, however many
    frames there are, and with other weights, of another seed or processor, their squares differ by a factor of three.
    """
    import xarray

    record_run(Scene.load(BEAD, duration=0.4), tmp_path / "run", device="cpu")
    file = tmp_path / "track.nc"
    words = ["vision", "track", str(tmp_path / "run"), "--net", str(net / kind), "--rings", "2", "--thickness", "0.2"]
    assert main([*words, "-o", str(file), "--device", "cpu"]) == 0
    assert "NIS per degree of freedom" in capfd.readouterr().out
    assert (tmp_path / "track.png").stat().st_size > 10_000
    with xarray.open_dataset(file) as track:
        off = (track.seen_position - track.true_position).values
        assert np.all(np.isfinite(off))
        assert np.sqrt(np.mean(off[:, :2] ** 2)) < 0.05
        assert np.sqrt(np.mean(off[:, 2] ** 2)) < 0.15
        assert 0.2 < float(track.nis.sum() / track.nis_degrees.sum()) < 2.0
        assert float(track.nees.sum() / track.nees_degrees.sum()) < chi2.isf(norm.sf(SIGMAS), 3) / 3.0


def test_a_network_states_its_errors(net: Path) -> None:
    """Of images of other places: their errors are independent of each other, and so are those it is calibrated on."""
    told = json.loads((net / "net" / "metrics.json").read_text())
    variance = sum(2.0 / (3.0 * told["images"][part]) for part in ("test", "validation"))
    assert abs(told["test"]["nees"] - 1.0) < SIGMAS * np.sqrt(variance)


@pytest.mark.parametrize("kind", ["net", "robot.onnx"])
def test_three_beads_are_found_in_a_frame(
    net: Path, frame: Path, kind: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Places and depths are those of the scene, within what the network says of its errors."""
    file = tmp_path / "found.csv"
    assert main(["vision", "find", str(frame), "--net", str(net / kind), "-o", str(file)]) == 0
    assert "3 found in 320 × 256 pixels" in capfd.readouterr().out
    assert sorted(p.name for p in tmp_path.iterdir()) == ["found.csv", "found.png"]
    with file.open(encoding="utf-8") as opened:
        rows = list(csv.DictReader(opened))
    assert [row["note"] for row in rows] == [""] * 3
    for row, (x, y, z) in zip(rows, PLACES, strict=True):
        for name, true in (("x", x), ("y", y), ("depth", z - 10.0)):
            sigma = float(row[f"sd_{name}_um"])
            assert sigma < 0.2 and abs(float(row[f"{name}_um"]) - true) < SIGMAS * sigma
            assert float(row[f"cov_{name}_{name}"]) == pytest.approx(sigma**2, rel=1e-4)
        assert float(row["column"]) == pytest.approx(160 + x / 0.065, abs=2.0)
        assert float(row["left"]) < float(row["column"]) < float(row["right"])


@pytest.mark.quick
def test_without_a_network_places_are_told(
    frame: Path, tmp_path: Path, monkeypatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["vision", "find", str(frame), "--pixel", "0.065", "--json"]) == 0
    said = json.loads(capfd.readouterr().out)["robots"]
    found = np.array([(one["x_um"], one["y_um"]) for one in said])
    assert np.abs(found - PLACES[:, :2]).max() < 0.1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["three_found.csv", "three_found.png"]


@pytest.mark.quick
@pytest.mark.parametrize(
    ("azimuth", "said"), [(0, False), (10, False), (60, True), (90, True), (-90, True), (175, False)]
)
def test_a_robot_that_lies_across_what_was_learnt_is_noted(azimuth: float, said: bool) -> None:
    """A network of one azimuth says something of any, and its yaw is the learnt one."""
    rows, columns = np.mgrid[-60:60, -60:60]
    c, s = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
    along, across = c * columns + s * rows, c * rows - s * columns
    noise = np.random.default_rng(1).normal(0.0, 1.0, rows.shape)
    frame = (90.0 + 80.0 * np.exp(-((along / 15.0) ** 2) - (across / 4.0) ** 2) + noise).astype(np.uint8)
    estimate = Estimate(
        x=0.0, y=0.0, depth=0.0, tilt=0.0, yaw=0.0, covariance=np.diag([1e-4, 1e-4, 1e-2, 1e-3, np.inf])
    )
    net = SimpleNamespace(
        about={"learnt": {"yaw": (0.0, 0.0)}}, pixel=0.1, shape=(80, 80), estimate=lambda _: [estimate]
    )
    (one,) = sightings(frame, cast(Any, net))
    assert ("the network has learnt azimuths of 0° alone" in one.note) == said


@pytest.mark.quick
def test_pieces_that_are_near_are_joined() -> None:
    image = np.full((96, 320), 100.0)
    for column in (40, 110, 250):
        image[40:52, column : column + 12] = 150.0
    assert len(find(image)) == 3
    assert [round(f.x) for f in find(image, join=60.0)] == [80, 256]
    with pytest.raises(InputError, match="join is -1; allowed: 0 or more"):
        find(image, join=-1.0)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        ("absent.tif", [], "cannot be read (there is no such file); allowed: images"),
        ("frame.csv", [], "ending = .csv; allowed: .png"),
        ("broken.png", [], "cannot be read"),
        ("colour.png", [], "images are in colour; allowed: grey ones"),
        ("dark.npy", [], "background of the frame is 0; allowed: above 0"),
        ("dark.npy", ["--page", "2"], "--page is 2; allowed: 0 to 0"),
        ("dark.npy", ["--net", "absent"], "absent"),
        ("dark.npy", ["-o", "x.txt"], "--out is x.txt; allowed: a file that ends with .csv"),
    ],
)
def test_nonsense_is_refused(
    name: str, words: list[str], said: str, tmp_path: Path, monkeypatch, capfd: pytest.CaptureFixture[str]
) -> None:
    from PIL import Image

    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.png").write_bytes(b"nothing")
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (32, 32, 3), dtype=np.uint8)).save("colour.png")
    np.save(tmp_path / "dark.npy", np.zeros((32, 32), dtype=np.uint8))
    before = sorted(tmp_path.iterdir())
    assert main(["vision", "find", name, *words]) == 2
    error = capfd.readouterr().err
    assert said in error and error.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


def test_a_network_of_another_robot_follows_none(net: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    record_run(Scene.load(BEAD.with_name("strategy_a.usda"), duration=0.05), tmp_path / "run", device="cpu")
    words = ["vision", "track", str(tmp_path / "run"), "--net", str(net / "net"), "-o", str(tmp_path / "track.nc")]
    assert main(words) == 2
    error = capfd.readouterr().err
    assert "/World/pair: the robot (/World/pair, 2 solids, 12.6 µm) is not that of the network" in error
    assert error.count("\n") == 1
    # all the same: its images do not hold the pair
    assert main([*words, "--any-robot"]) == 2
    assert "--size (or the network's) is 64 pixels" in capfd.readouterr().err
