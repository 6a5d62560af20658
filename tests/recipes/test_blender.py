"""A recorded run and a scene in Blender, by the recipe: colours, opacities, motion and a picture.

Blender is a module of a Python of its own (`make blender`); CI sets OTWARP_REQUIRE_BLENDER=1, others skip without it.
"""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from PIL import Image

from otwarp.record import record_run
from otwarp.scene import Scene, export_stage
from otwarp.scene.drawing.drawables import read_drawables

ROOT = Path(__file__).parents[2]
PROBE = Path(__file__).with_name("blender_probe.py")
BLENDER = ROOT / ".venv-blender" / "bin" / "python"
COLOUR, PLACE = 1e-6, 2e-6
"""Blender keeps colours and places [µm] in single precision: up to 10 µm from the origin."""


def in_blender(file: Path, folder: Path, camera: str, frames: list[int]) -> tuple[dict, np.ndarray]:
    """What Blender holds of a file, and its picture (h, w, 3) from 0 to 1."""
    if not BLENDER.exists():
        if os.environ.get("OTWARP_REQUIRE_BLENDER") == "1":
            pytest.fail("OTWARP_REQUIRE_BLENDER=1, and there is no .venv-blender: `make blender`")
        pytest.skip("Blender is absent: `make blender`")
    picture = folder / "still.png"
    command = [BLENDER, PROBE, file, picture, camera, json.dumps(frames)]
    ran = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=300, check=False)
    assert ran.returncode == 0, ran.stderr
    line = next(row for row in ran.stdout.splitlines() if row.startswith("SAID "))
    return json.loads(line.removeprefix("SAID ")), np.asarray(Image.open(picture).convert("RGB")) / 255.0


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("blender") / "run"
    scene = Scene.load(ROOT / "scenes" / "two_trap_dimer.usda")
    record_run(dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, duration=0.2)), folder)
    return folder


def share(picture: np.ndarray, color: str) -> float:
    """Share of the pixels in which one channel leads the others clearly."""
    channel = "rgb".index(color)
    return float((picture[..., channel] > 1.3 * np.delete(picture, channel, axis=2).max(axis=2)).mean())


@pytest.mark.parametrize("meshes", [False, True])
def test_a_recorded_run_has_its_colours_moves_as_recorded_and_is_not_white(run: Path, tmp_path: Path, meshes: bool):
    file = export_stage(run / "run.usda", tmp_path / "run.usda", meshes=True) if meshes else run / "run.usda"
    said, picture = in_blender(file, tmp_path, "view", [0, 7, 12])
    assert (said["fps"], said["frames"]) == (60, [0, 12])
    robot, red, cyan = (0.90, 0.27, 0.04), (1.0, 0.10, 0.07), (0.03, 0.75, 1.0)
    looks = {name: np.array(rows) for name, rows in said["objects"].items()}
    np.testing.assert_allclose(looks["rod"], [[*robot, 1.0]], atol=COLOUR)
    beams = sorted(looks["BeamAbove"].tolist())
    np.testing.assert_allclose(beams, [[*cyan, 0.25], [*red, 0.25]], atol=COLOUR)
    # Blender binds no material to a shape, but meshes; the colours of shapes are there, and it can show them
    assert {count for count, _ in said["plain"].values()} == ({1} if meshes else {0})
    for name, (_, look) in said["plain"].items():
        if not meshes:
            assert min(np.abs(np.subtract(look, row)).max() for row in looks[name.split(".")[0]]) <= COLOUR
    with netCDF4.Dataset(run / "run.nc") as recorded:
        for frame, places in said["places"].items():
            place = recorded["position"][int(frame), 0, 0].data
            np.testing.assert_allclose(places["dimer"], place, atol=PLACE)
    assert np.ptp([places["dimer"] for places in said["places"].values()], axis=0).max() > 10 * PLACE
    assert (picture.min(axis=2) > 0.97).mean() < 0.02
    assert share(picture, "r") > 0.02  # the robot and a beam
    assert picture.std() > 0.05


def test_a_scene_shows_what_the_preview_shows(tmp_path: Path):
    scene = ROOT / "scenes" / "cell_delivery.usda"
    file = export_stage(scene, tmp_path / "scene.usdc", meshes=True)
    said, picture = in_blender(file, tmp_path, "closeup", [0])
    assert len(said["objects"]["floor"]) == 1
    drawn = read_drawables(scene)
    shown = np.round(np.concatenate([drawn.colour, drawn.opacity[:, None]], axis=1), 2)
    found = np.round([look for rows in said["objects"].values() for look in rows], 2)
    assert set(map(tuple, found.tolist())) == set(map(tuple, shown.tolist()))
    assert (picture.min(axis=2) > 0.97).mean() < 0.01
    assert share(picture, "b") > 0.3  # the floor


def test_words_for_what_is_not_there(run: Path, tmp_path: Path):
    if not BLENDER.exists():
        pytest.skip("Blender is absent: `make blender`")
    recipe = [str(BLENDER), str(ROOT / "docs" / "recipes" / "blender.py")]
    for given, word in (["none.usda"], "no such file"), ([str(run / "run.usda"), "--camera", "nose"], "view"):
        ran = subprocess.run([*recipe, *given], capture_output=True, text=True, timeout=120, check=False)
        assert ran.returncode == 1
        assert word in ran.stderr
