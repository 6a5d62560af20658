"""Bad files: one line that names file, prim, attribute, value and allowed range, and nothing from USD on stderr."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.scene import Scene, SceneBuilder, Settings
from tests.scene.conftest import STAGE, StageFile

PLATES = "double ot:flow:halfHeight = 1e-5"
TRAP = '["OtTrapAPI", "OtTrapLawAPI:isotropic"]'
LAW = STAGE[STAGE.index("        double ot:trapLaw") : STAGE.index("        double3 xformOp:translate.time")]
SAMPLES = "{ 0: (0, 0, 5), 60: (6, 0, 5) }"

# name: what to change, then what the message must say after the file: prim, attribute, value, allowed.
CASES: dict[str, tuple[list[tuple[str, str]], str]] = {
    "no default prim": ([('    defaultPrim = "World"\n', "")], r"/: defaultPrim = \(absent\): must be the name of"),
    "wrong default prim": ([('defaultPrim = "World"', 'defaultPrim = "W"')], r"/: defaultPrim = W: must be"),
    "unit zero": ([("= 1e-6\n    start", "= 0\n    start")], r"/: metersPerUnit = 0.0: must be in \(0, inf\)"),
    "unit negative": ([("= 1e-6\n    start", "= -1\n    start")], r"/: metersPerUnit = -1.0: must be in \(0, inf\)"),
    "unit absent": ([("    metersPerUnit = 1e-6\n", "")], r"/: metersPerUnit = \(absent\): must be authored, in \(0,"),
    "Y up": ([('upAxis = "Z"', 'upAxis = "Y"')], r"/: upAxis = Y: must be Z"),
    "up axis absent": ([('    upAxis = "Z"\n', "")], r"/: upAxis = Y: must be Z"),
    "end before start": ([("endTimeCode = 60", "endTimeCode = -1")], r"/: endTimeCode = -1.0: must be in \(0, inf\)"),
    "no time codes": ([("timeCodesPerSecond = 60", "timeCodesPerSecond = 0")], r"/: timeCodesPerSecond = 0.0: must be"),
    "bad frame rate": ([("framesPerSecond = 30", "framesPerSecond = 0")], r"framesPerSecond.*: must be"),
    "misspelt attribute": (
        [("ot:trap:power", "ot:trap:powr")],
        r"/World/Trap: ot:trap:powr = \(unknown attribute\): must be .*did you mean ot:trap:power\?",
    ),
    "prefix in capitals": (
        [("double ot:trap:power", "double OT:trap:power")],
        r"/World/Trap: OT:trap:power = \(unknown attribute\): must be .*did you mean ot:trap:power\?",
    ),
    "radius that changes": (
        [("double radius = 1.5", "double radius.timeSamples = { 0: 1.5, 60: 2 }")],
        r"/World/Robot/Ball: radius = \(time samples\): must be constant in time",
    ),
    "too far away": (
        [("translate = (10, 0, 5)", "translate = (10, -2e9, 5)")],
        r"/World/Cell: xformOp:translate = 2e\+09 µm from the origin: must be within 1e\+09 µm of it",
    ),
    "misspelt schema": (
        [("OtCellAPI", "OtCelAPI")],
        r"/World/Cell: apiSchemas = OtCelAPI: must be .*did you mean OtCellAPI\?",
    ),
    "schema not applied": (
        [('"OtTrapAPI", ', "")],
        r"/World/Trap: ot:trap:\w+ = .*: must be on a prim with OtTrapAPI applied",
    ),
    "law instance not applied": (
        [("ot:trapLaw:isotropic:stiffness", "ot:trapLaw:radial:stiffness")],
        r"ot:trapLaw:radial:stiffness = 2.0: must be on a prim with OtTrapLawAPI:radial applied",
    ),
    "wrong type": (
        [("double ot:trap:power = 0.03", 'string ot:trap:power = "much"')],
        r"/World/Trap: ot:trap:power = .*\(type string\): must be of type double, \[0, 10\]",
    ),
    "float for double": (
        [("double ot:trap:power", "float ot:trap:power")],
        r"/World/Trap: ot:trap:power = .*\(type float\): must be of type double",
    ),
    "attribute for relationship": (
        [("rel ot:trap:holds = </World/Robot/Ball>", 'string ot:trap:holds = "Ball"')],
        r"/World/Trap: ot:trap:holds = .*\(type string\): must be of type rel",
    ),
    "out of range": ([("power = 0.03", "power = 30")], r"/World/Trap: ot:trap:power = 30.0: must be in \[0, 10\] W"),
    "NaN power": ([("power = 0.03", "power = nan")], r"/World/Trap: ot:trap:power = nan: must be in \[0, 10\] W"),
    "NaN power sample": (
        [("power = 0.03", "power.timeSamples = { 0: 0.03, 60: nan }")],
        r"/World/Trap: ot:trap:power = nan: must be in \[0, 10\] W",
    ),
    "infinite stiffness": (
        [("stiffness = 2", "stiffness = inf")],
        r"/World/Trap: ot:trapLaw:isotropic:stiffness = inf: must be in \[0, inf\) forceUnit/lengthUnit",
    ),
    "unit of a law that no number holds": (
        [("isotropic:lengthUnit = 1e-6", "isotropic:lengthUnit = 1e300")],
        r"ot:trapLaw:isotropic:lengthUnit = 1e\+300: must be in \(0, inf\) m, of a size from 1e-60 to 1e\+60",
    ),
    "viscosity that vanishes": (
        [("double ot:medium:refractiveIndex = 1.33", "double ot:medium:viscosity = 1e-300")],
        r"/World: ot:medium:viscosity = 1e-300: must be in \(0, 1000\] Pa·s, of a size from 1e-60 to 1e\+60 where it",
    ),
    "curve that ends in nothing": (
        [("isotropic:lengthUnit = 1e-6", "isotropic:lengthUnit = 1e-6\n double ot:trapLaw:isotropic:cutoff = 1e-300")],
        r"ot:trapLaw:isotropic:cutoff = 1e-300: must be in \(0, inf\] lengthUnit, of a size from 1e-60 to 1e\+60",
    ),
    "stage unit that vanishes": (
        [("metersPerUnit = 1e-6", "metersPerUnit = 1e-300")],
        r"radius = .*e-294: must be in \[1e-30, 1e\+09\] µm",
    ),
    "sampled constant": (
        [("wavelength = 1.064e-6", "wavelength.timeSamples = { 0: 1e-6, 60: 1.1e-6 }")],
        r"/World/Trap: ot:trap:wavelength = \(time samples\): must be constant in time",
    ),
    "NA above index": (
        [("numericalAperture = 1.2", "numericalAperture = 1.33")],
        r"/World/Trap: ot:trap:numericalAperture = 1.33: must be in \(0, 1.33\), below the refractive index",
    ),
    "unknown model": (
        [('model = "piecewise"', 'model = "magic"')],
        r"/World/Trap: ot:trap:model = magic: must be one of harmonic, piecewise",
    ),
    "no law": (
        [(LAW, ""), (TRAP, '["OtTrapAPI"]')],
        r"/World/Trap: OtTrapLawAPI = \(none\): must be isotropic alone, or radial and axial together",
    ),
    "radial alone": (
        [(TRAP, '["OtTrapAPI", "OtTrapLawAPI:isotropic", "OtTrapLawAPI:radial"]')],
        r"/World/Trap: OtTrapLawAPI = isotropic, radial: must be isotropic alone, or",
    ),
    "trap off a transform": (
        [('def Xform "Trap"', 'def Scope "Trap"')],
        r"apiSchemas = OtTrapAPI: must be on an Xform",
    ),
    "samples end early": (
        [(SAMPLES, "{ 0: (0, 0, 5), 59: (6, 0, 5) }")],
        r"/World/Trap: xformOp:translate = time samples from 0 s to 0.98\d* s: must be samples that cover the run, "
        r"\[0, 1\] s; the last value again at time code 60 holds it",
    ),
    "samples start late": (
        [(SAMPLES, "{ 1: (0, 0, 5), 60: (6, 0, 5) }")],
        r"/World/Trap: xformOp:translate = time samples from 0.01\d* s to 1 s: must be samples that cover .*; "
        "the first value again at time code 0 holds it",
    ),
    "power samples end early": (
        [("power = 0.03", "power.timeSamples = { 0: 0.03, 30: 0.01 }")],
        r"/World/Trap: ot:trap:power = time samples from 0 s to 0.5 s: must be samples that cover",
    ),
    "trap turns": (
        [
            (
                f"double3 xformOp:translate.timeSamples = {SAMPLES}",
                "float xformOp:rotateX.timeSamples = {0: 0, 60: 90}",
            ),
            ("xformOp:translate", "xformOp:rotateX"),
        ],
        r"/World/Trap: xformOp:orient = \(time samples that turn\): must be constant",
    ),
    "holds a stranger": (
        [("holds = </World/Robot/Ball>", "holds = </World/Robot/Bell>")],
        r"/World/Trap: ot:trap:holds = /World/Robot/Bell: must be a sphere of a body",
    ),
    "holds an untrapped sphere": (
        [("double ot:sphere:refr", "bool ot:sphere:trapped = false\n double ot:sphere:refr")],
        r"/World/Trap: ot:trap:holds = /World/Robot/Ball: must be a sphere of a body",
    ),
    "holds two": (
        [("holds = </World/Robot/Ball>", "holds = [</World/Robot/Ball>, </World/Cell>]")],
        r"ot:trap:holds = /World/Robot/Ball, /World/Cell: must be one prim path",
    ),
    "negative radius": ([("radius = 3", "radius = -3")], r"/World/Cell: radius = -3.0: must be in \(0, inf\)"),
    "NaN radius": ([("radius = 1.5", "radius = nan")], r"/World/Robot/Ball: radius = nan: must be in \(0, inf\)"),
    "body without spheres": (
        [(' (prepend apiSchemas = ["OtSphereAPI"])', ""), ("            double ot:sphere:refractiveIndex = 1.5\n", "")],
        r"/World/Robot: OtSphereAPI = \(no sphere below\): must be on at least one",
    ),
    "sphere without body": (
        [('["OtBodyAPI", "PhysicsRigidBodyAPI"]', '["PhysicsRigidBodyAPI"]')],
        r"/World/Robot/Ball: apiSchemas = OtSphereAPI: must be below a prim with OtBodyAPI",
    ),
    "uneven scale": (
        [("scale = (1, 1, 1)", "scale = (1, 1, 1.5)")],
        r"/World/Robot/Ball: xformOp:scale = \(1, 1, 1.5\): must be uniform on a sphere",
    ),
    "zero scale": ([("scale = (1, 1, 1)", "scale = (1, 1, 0)")], r"Ball: xformOp:scale = 0: must be nonzero"),
    "position not finite": (
        [("(10, 0, 5)", "(10, nan, 5)")],
        r"/World/Cell: xformOp:translate\[1\] = nan: must be finite",
    ),
    "nested bodies": (
        [('def Sphere "Ball"', 'def Sphere "Inner" (prepend apiSchemas = ["OtCellAPI"]) {}\n def Sphere "Ball"')],
        r"/World/Robot/Inner: apiSchemas = Inner: must be outside the body /World/Robot",
    ),
    "cell not a sphere": ([('def Sphere "Cell"', 'def Cube "Cell"')], r"OtCellAPI: must be on a Sphere, not a Cube"),
    "mobility too short": (
        [
            (
                "double3 xformOp:translate = (0, 0, 5)",
                "double[] ot:body:mobility = [1, 2]\n double3 xformOp:translate = (0, 0, 5)",
            )
        ],
        r"/World/Robot: ot:body:mobility = \[1, 2\]: must be 36 finite numbers or none",
    ),
    "bodies overlap": (
        [("(10, 0, 5)", "(4.2, 0, 5)")],
        r"/World/Robot: overlap with /World/Cell = 0.3 µm: must be at most 0.15 µm at the start",
    ),
    "overlap with obstacle": (
        [("(20, 0, 1)", "(13.5, 0, 5)")],
        r"/World/Cell: overlap with /World/Block = 0.5 µm: must be at most 0.3 µm at the start",
    ),
    "unsupported collider": ([('def Cube "Block"', 'def Cone "Block"')], r"must be on one of Cube, .*, not Cone"),
    "goal without cell": (
        [("rel ot:goal:cell = </World/Cell>", "rel ot:goal:cell = </World/Block>")],
        r"/World/Goal: ot:goal:cell = /World/Block: must be one prim with OtCellAPI, or the only robot",
    ),
    "goal cell missing": (
        [("        rel ot:goal:cell = </World/Cell>\n", "")],
        r"ot:goal:cell = \(no target\): must be",
    ),
    "goal without robots": (
        [("[</World/Robot>]", "[</World/Robot>, </World/Cell>]")],
        r"/World/Goal: ot:goal:robots = /World/Cell: must be prims with OtBodyAPI",
    ),
    "plates without distance": (
        [(PLATES, "double ot:flow:halfHeight = 0")],
        r"/World/Flow: ot:flow:halfHeight = 0.0: must be in \(0, inf\) m for poiseuille",
    ),
    "plates of negative distance": (
        [(PLATES, "double ot:flow:halfHeight = -1")],
        r"/World/Flow: ot:flow:halfHeight = -1.0: must be in \[0, inf\) m",
    ),
    "two flows": (
        [
            (
                'def Xform "Goal" (prepend apiSchemas = ["OtGoalAPI"',
                'def Xform "Goal" (prepend apiSchemas = ["OtGoalAPI", "OtFlowAPI"',
            )
        ],
        r"/World/Goal: apiSchemas = OtFlowAPI: must be on one prim only; /World/Flow has it already",
    ),
    "camera schema elsewhere": (
        [('["OtFlowAPI"]', '["OtFlowAPI", "OtCameraAPI"]')],
        r"/World/Flow: apiSchemas = OtCameraAPI: must be on a Camera, not a Xform",
    ),
    "scene schema elsewhere": (
        [('["OtFlowAPI"]', '["OtFlowAPI", "OtSceneAPI"]')],
        r"/World/Flow: apiSchemas = OtSceneAPI: must be on the default prim",
    ),
    "unresolved reference": (
        [('def Xform "Flow" (prepend', 'def Xform "Flow" (prepend references = @missing.usda@\n prepend')],
        r"/World/Flow: composition = .*missing.usda.*: must be a reference that resolves",
    ),
}


def refused(path: Path, capfd: pytest.CaptureFixture[str], **options: float) -> str:
    """The message of the InputError, after checking that it is one line and the only output."""
    with pytest.raises(InputError) as caught:
        Scene.load(path, **options)
    assert capfd.readouterr() == ("", "")
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    return message.removeprefix(f"{path}: ")


def test_the_stage_itself_is_good(stage_file: StageFile, capfd: pytest.CaptureFixture[str]) -> None:
    assert len(stage_file.load().bodies) == 2
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("case", CASES)
def test_refused_in_one_line(case: str, stage_file: StageFile, capfd: pytest.CaptureFixture[str]) -> None:
    changes, expected = CASES[case]
    message = refused(stage_file.write(*changes), capfd)
    assert re.search(expected, message), message


def test_missing_file(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert refused(tmp_path / "none.usda", capfd).startswith("there is no such file; a scene must be a USD file")
    assert refused(tmp_path, capfd).startswith("file = a folder: must be a USD file")


@pytest.mark.parametrize("name", ["scene.txt", "scene", "scene.usda", "scene.usdc", "scene.usd"])
def test_not_usd(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / name
    path.write_text("trap power 20 mW\n")
    assert "must be a USD file" in refused(path, capfd)


def test_syntax_error_names_the_line(stage_file: StageFile, capfd: pytest.CaptureFixture[str]) -> None:
    assert "must be a USD file" in refused(stage_file.write(("double radius = 3", "double radius = = 3")), capfd)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_truncated_crate(share: float, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    whole = SceneBuilder(settings=Settings(duration=1.0)).save(tmp_path / "whole.usdc").read_bytes()
    path = tmp_path / "cut.usdc"
    path.write_bytes(whole[: int(share * len(whole))])
    assert "must be a USD file" in refused(path, capfd)


@pytest.mark.parametrize("duration", [-1.0, 0.0, float("nan"), float("inf")])
def test_bad_duration(duration: float, stage_file: StageFile, capfd: pytest.CaptureFixture[str]) -> None:
    message = refused(stage_file.write(), capfd, duration=duration)
    assert message == f"/: duration = {duration}: must be in (0, inf) s"


def test_longer_run_than_samples(stage_file: StageFile, capfd: pytest.CaptureFixture[str]) -> None:
    path = stage_file.write()
    assert Scene.load(path, duration=1.0 + 5e-10).settings.duration == 1.0 + 5e-10  # within the slack of 1e-9 s
    assert "must be samples that cover the run, [0, 1.1] s" in refused(path, capfd, duration=1.1)


def test_bad_instancers(stage_file: StageFile, capfd: pytest.CaptureFixture[str]) -> None:
    cells = """def PointInstancer "Cells" {
        rel prototypes = [</World/Cells/Kind>]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(100, 0, 5), (110, 0, 5)]
        def Sphere "Kind" (prepend apiSchemas = ["OtCellAPI"])
        {
            double radius = 3
        }
    }
    def Cube "Block" """
    good = ('def Cube "Block"', cells)
    radius = "double radius = 3\n        }"
    assert len(stage_file.load(good).bodies) == 4
    for change, expected in (
        (("(110, 0, 5)]", "(110, 0, 5)]\n float3[] scales = [(1, 1, 1), (1, 2, 1)]"), "/World/Cells: xformOp:scale = "),
        (("[0, 0]", "[0, 1]"), "/World/Cells: protoIndices = 0 … 1: must be in [0, 0]"),
        (("(100, 0, 5), (110, 0, 5)]", "(100, 0, 5), (103, 0, 5)]"), "/World/Cells[0]: overlap with /World/Cells[1]"),
        (("(110, 0, 5)]", "(nan, 0, 5)]"), "/World/Cells: positions[1][0] = nan: must be finite"),
        (("</World/Cells/Kind>", "</World/Cells/Sort>"), "/World/Cells: prototypes = (a path without a prim)"),
        (
            ('Sphere "Kind" (prepend apiSchemas = ["OtCellAPI"', 'Sphere "Kind" (prepend apiSchemas = ["OtBodyAPI"'),
            "/World/Cells/Kind: apiSchemas = OtBodyAPI",
        ),
        ((radius, "double radius = -3\n        }"), "/World/Cells/Kind: radius = -3.0"),
        ((radius, "double ot:cell:youngModulus = 3\n        }"), "/World/Cells/Kind: ot:cell:youngModulus"),
        (
            (
                'Sphere "Kind" (prepend apiSchemas = ["OtCellAPI"',
                'Sphere "Kind" (prepend apiSchemas = ["PhysicsCollisionAPI"',
            ),
            "/World/Cells/Kind: apiSchemas = PhysicsCollisionAPI: must be on a cell, or outside a PointInstancer",
        ),
        (
            ('PointInstancer "Cells"', 'PointInstancer "Cells" (prepend apiSchemas = ["PhysicsCollisionAPI"])'),
            "/World/Cells: apiSchemas = PhysicsCollisionAPI: must be on prims that are obstacles",
        ),
    ):
        assert refused(stage_file.write(good, change), capfd).startswith(expected)
    head = '["OtCellAPI"])\n        {\n            double radius = 3\n'
    solid = (head, head.replace('["OtCellAPI"', '["OtCellAPI", "PhysicsCollisionAPI"'))
    assert len(stage_file.load(good, solid).bodies) == 4
