"""Reports on files: USD's own validators find nothing in what SceneBuilder writes, and something in bad stages."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from otwarp.scene import SceneBuilder
from otwarp.scene.read.validate import validate
from tests.scene.conftest import StageFile
from tests.scene.write.test_builder import LAW, STILL_TRAP, full_builder


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_an_authored_stage_passes_every_validator(suffix: str, tmp_path: Path, capfd) -> None:
    report = validate(full_builder().save(tmp_path / f"scene{suffix}"))
    assert report.ok
    assert report.findings == ()
    assert capfd.readouterr() == ("", "")


def test_the_validators_really_run(stage_file: StageFile) -> None:
    nested = (
        'def Cube "Block"',
        'def Cube "Outer" {\n def Cube "Inner" {\n rel material:binding = </World>\n }\n }\n def Cube "Block"',
    )
    report = validate(stage_file.write(nested))
    assert not report.ok
    messages = {(finding.prim, finding.message.split("[")[-1].rstrip("]")) for finding in report.errors}
    assert ("/World/Outer/Inner", "usdGeomValidators:EncapsulationChecker.InvalidNestedGprims") in messages
    assert any(prim == "/World/Outer/Inner" and "MaterialBindingApiApplied" in name for prim, name in messages)


def test_errors_of_the_loader_are_findings(stage_file: StageFile, tmp_path: Path) -> None:
    (finding, *_) = validate(stage_file.write(("radius = 3", "radius = -3"))).errors
    assert (finding.severity, finding.prim) == ("error", "/World/Cell")
    assert finding.message.startswith("radius = -3.0: must be in (0, inf)")
    (missing,) = validate(tmp_path / "none.usda").findings
    assert (missing.prim, missing.message.split(";")[0]) == ("/", "there is no such file")
    assert not validate(tmp_path / "none.usda").ok


@pytest.mark.parametrize("change", [("metersPerUnit = 1e-6", ""), ("double radius = 3", "float radius = 3")])
def test_what_usd_says_as_well_is_said_once(change: tuple[str, str], stage_file: StageFile) -> None:
    (finding,) = validate(stage_file.write(change)).errors
    assert finding.message.startswith(("metersPerUnit = (absent)", "radius = 3.0 (type float)"))


def test_advice(stage_file: StageFile, tmp_path: Path) -> None:
    warnings = {str(finding) for finding in validate(stage_file.write()).warnings}
    assert any("no camera" in text for text in warnings)
    assert any("no light" in text for text in warnings)
    stray = validate(stage_file.write(('["OtFlowAPI"]', '["OtFlowAPI", "OtTrapLawAPI:radial"]'))).warnings
    assert any("OtTrapLawAPI:radial is unused" in str(finding) for finding in stray)

    builder = SceneBuilder()
    builder.add(dataclasses.replace(STILL_TRAP, radial=LAW))
    builder.add_light("/World/Light")
    view = builder.add_view("/World/View", (0, 0, 50), (0, 0, 0))
    path = builder.save(tmp_path / "harmonic.usda")
    unused = [finding.message for finding in validate(path).findings if "unused" in finding.message]
    assert unused == [
        f"{field} of the isotropic law is unused: the model is harmonic"
        for field in ("threshold", "inverse_square", "offset")
    ]
    for near, far, expected in ((0.0, 10.0, "is not usable"), (1.0, 2.0, "shows no body or trap")):
        view.GetAttribute("clippingRange").Set((near, far))
        found = validate(builder.save(path)).warnings
        assert any(finding.prim == "/World/View" and expected in finding.message for finding in found)
