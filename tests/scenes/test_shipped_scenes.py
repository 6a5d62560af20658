"""Every shipped stage is what its script writes, loads back equal, validates, and has every value authored."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.scene import Scene, vocabulary
from otwarp.scene.read.validate import validate
from scenes.author.__main__ import FOLDER, NAMES, main, save


@pytest.fixture(scope="module", params=NAMES)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


def test_every_stage_has_a_script_and_every_script_a_stage():
    assert {file.stem for file in FOLDER.glob("*.usda")} == set(NAMES)


NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")

LAST_DIGIT = 2e-9
"""Numbers that are computed are written with nine decimals; processors may disagree about the last one."""

SINGLE = 3e-7
"""Two roundings of a float32, which cameras are made of."""


def words_and_numbers(file: Path) -> tuple[str, np.ndarray]:
    """A text without its numbers, and these."""
    text = file.read_text()
    return NUMBER.sub("#", text), np.array(NUMBER.findall(text), dtype=float)


def test_regenerates_to_the_same_words_and_numbers(name: str, tmp_path: Path):
    words, numbers = words_and_numbers(FOLDER / f"{name}.usda")
    again, regenerated = words_and_numbers(save(name, tmp_path))
    assert again == words
    np.testing.assert_allclose(regenerated, numbers, rtol=SINGLE, atol=LAST_DIGIT)


def test_loads_back_equal(name: str, tmp_path: Path):
    built = importlib.import_module(f"scenes.author.{name}").build()
    assert Scene.load(built.save(tmp_path / f"{name}.usda")) == built.scene()


def test_no_number_has_more_digits_than_it_means(name: str):
    """A text that depends on the processor is no reference: what is computed is rounded before it is written."""
    long = [n for n in re.findall(r"\d+\.(\d+)", (FOLDER / f"{name}.usda").read_text()) if len(n) > 12]
    assert not long


def test_validates_without_error(name: str):
    findings = validate(FOLDER / f"{name}.usda").findings
    assert [f for f in findings if f.severity == "error"] == []


def test_every_vocabulary_value_is_authored(name: str):
    stage = Usd.Stage.Open(str(FOLDER / f"{name}.usda"))
    schemas = {schema.name: schema for schema in vocabulary.SCHEMAS}
    seen = 0
    for prim in stage.Traverse():
        for applied in prim.GetPrimTypeInfo().GetAppliedAPISchemas():
            base, _, instance = applied.partition(":")
            if base not in schemas:
                continue
            for attribute in schemas[base].attributes:
                if attribute.usd_type == "rel" or attribute.optional:
                    continue
                authored = prim.GetAttribute(attribute.name.replace("__INSTANCE_NAME__", instance))
                assert authored.HasAuthoredValue(), f"{prim.GetPath()}: {authored.GetName()}"
                seen += 1
    assert seen > 0


def test_stage_has_native_units_camera_lights_and_sixty_frames_per_second(name: str):
    stage = Usd.Stage.Open(str(FOLDER / f"{name}.usda"))
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1e-6
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == 60.0
    types = [prim.GetTypeName() for prim in stage.Traverse()]
    assert {"DistantLight", "DomeLight"} <= set(types)
    cameras = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]
    assert cameras[0].GetName() == "view"
    near, far = UsdGeom.Camera(cameras[0]).GetClippingRangeAttr().Get()
    assert 0.0 < near < far / 100.0


def test_traps_hold_what_they_name_at_their_equilibrium(name: str):
    scene = Scene.load(FOLDER / f"{name}.usda")
    places = {}
    for body in scene.bodies:
        for sphere in body.spheres:
            places[sphere.prim] = np.array(body.position) + _rotate(body.orientation, np.array(sphere.offset))
    reach = {"strategy_a": 3.8}.get(name, 0.9)  # strategy A starts tilted, far from its traps
    for trap in scene.traps:
        held = trap.position.at(0.0) + np.array([0.0, 0.0, trap.equilibrium])
        assert trap.holds in places
        assert np.linalg.norm(places[trap.holds] - held) < reach


def test_unknown_stage_is_one_line_and_code_2(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(InputError, match="must be one of single_bead"):
        save("cell_delivry")
    assert main(["cell_delivry"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def _rotate(quaternion: tuple[float, float, float, float], vector: np.ndarray) -> np.ndarray:
    axis, w = np.array(quaternion[:3]), quaternion[3]
    return vector + 2 * np.cross(axis, np.cross(axis, vector) + w * vector)
