"""Every value of a USD attribute comes in by one door, which refuses wrong types, blocked and missing values."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import otwarp
from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.scene.drawing.drawables import read_drawables
from tests.scene.conftest import StageFile

PACKAGE = Path(otwarp.__file__).parent
DOOR = PACKAGE / "scene" / "read" / "typed.py"
UNUSED = PACKAGE / "scene" / "read" / "read_through.py"
"""Reads values to see whether USD survives it, and looks at none."""

RADIUS, SIZE, MOVE = "double radius = 3", "double size = 2", "double3 xformOp:translate = (10, 0, 5)"
POWER = "double ot:trap:power = 0.03"
ORDER = f'{MOVE}\n        uniform token[] xformOpOrder = ["xformOp:translate"]'
VECTORS = "must be of type double3 or float3 or half3"
LEAST = "rel prototypes = </World/I/C>\nint[] protoIndices = [0]\npoint3f[] positions = [(99, 0, 0)]\n"


def cylinder(text: str) -> list[tuple[str, str]]:
    return [('def Cube "Block"', 'def Cylinder "Block"'), (SIZE, text)]


def mesh(text: str) -> list[tuple[str, str]]:
    return [('def Cube "Block"', 'def Mesh "Block"'), (SIZE, text)]


def instancer(text: str, least: str = LEAST) -> list[tuple[str, str]]:
    cell = 'def Sphere "C" (prepend apiSchemas = ["OtCellAPI"])\n{\ndouble radius = 1\n}'
    return [
        ('    def Cube "Block"', f'    def PointInstancer "I"\n{{\n{least}{text}\n{cell}\n}}\n\n    def Cube "Block"')
    ]


CASES: dict[str, tuple[list[tuple[str, str]], str]] = {
    "text": ([(RADIUS, 'string radius = "big"')], r"/World/Cell: radius = big \(type string\): must be of type double"),
    "array": (
        [(RADIUS, "double[] radius = [1, 2]")],
        r"/World/Cell: radius = \[1, 2\] \(type double\[\]\): must be of type double",
    ),
    "single precision": ([(RADIUS, "float radius = 3")], r"radius = 3.0 \(type float\): must be of type double"),
    "relationship": ([(RADIUS, "rel radius = </World>")], r"radius = /World \(type rel\): must be of type double"),
    "blocked": ([(RADIUS, "double radius = None")], r"/World/Cell: radius = None \(blocked\): must be of type double"),
    "array of sizes": ([(SIZE, "double[] size = [2]")], r"/World/Block: size = \[2\] \(type double\[\]\): must be"),
    "no such axis": (cylinder('token axis = "Q"'), "/World/Block: axis = Q: must be one of X, Y, Z"),
    "empty axis": (cylinder('token axis = ""'), r"/World/Block: axis = \(empty\): must be one of X, Y, Z"),
    "point that is no number": (
        mesh("point3f[] points = [(0, 0, 0), (0, nan, 0)]"),
        r"/World/Block: points\[1\]\[1\] = nan: must be finite, within ±1e\+30",
    ),
    "no rotation": (
        [(ORDER, ORDER.replace("double3", "quatd").replace("translate", "orient").replace("10, 0, 5", "0, 0, 0, 0"))],
        r"/World/Cell: xformOp:orient = \(0, 0, 0, 0\): must be a quaternion that is not zero",
    ),
    "axis as a string": (cylinder('string axis = "Z"'), r"axis = Z \(type string\): must be of type token"),
    "points as a string": (mesh('string points = "a"'), r"points = a \(type string\): must be of type point3f\[\]"),
    "points in double precision": (mesh("point3d[] points = [(0, 0, 0)]"), r"\(type point3d\[\]\): must be of type p"),
    "points that move": (mesh("point3f[] points.timeSamples = { 0: [(0, 0, 0)] }"), "must be constant in time"),
    "translate as a string": (
        [(MOVE, 'string xformOp:translate = "far"')],
        rf"/World/Cell: xformOp:translate = far \(type string\): {VECTORS}",
    ),
    "translate as a number": ([(MOVE, "float xformOp:translate = 3")], rf"3.0 \(type float\): {VECTORS}"),
    "translate blocked": (
        [(MOVE, "double3 xformOp:translate = None")],
        rf"/World/Cell: xformOp:translate = None \(blocked\): {VECTORS}",
    ),
    "translate sample blocked": (
        [(MOVE, "double3 xformOp:translate.timeSamples = { 0: (10, 0, 5), 60: None }")],
        rf"xformOp:translate = a time sample None \(blocked\): {VECTORS}",
    ),
    "translate absent": ([(MOVE, "")], rf"xformOp:translate = \(absent\): {VECTORS}"),
    "no such op": (
        [(ORDER, ORDER.replace("translate", "fly"))],
        "/World/Cell: xformOpOrder = xformOp:fly: must be names of transform ops",
    ),
    "order as a string": (
        [(ORDER, f'{MOVE}\nstring xformOpOrder = "xformOp:translate"')],
        r"xformOpOrder = xformOp:translate \(type string\): must be of type token\[\]",
    ),
    "visibility as a string": ([(RADIUS, f'{RADIUS}\nstring visibility = "invisible"')], "must be of type token"),
    "no such purpose": ([(RADIUS, f'{RADIUS}\nuniform token purpose = "none"')], "purpose = none: must be one of "),
    "positions as a string": (
        instancer('string positions = "a"', LEAST.replace("point3f[] positions = [(99, 0, 0)]\n", "")),
        r"/World/I: positions = a \(type string\): must be of type point3f\[\]",
    ),
    "not as many ids": (instancer("int64[] ids = [1, 2]\nint64[] invisibleIds = [2]"), r"/World/I: ids = 2 ids: must"),
    "ids of another type": (instancer("int[] ids = [1]"), r"\(type int\[\]\): must be of type int64\[\]"),
}

NOT_DRAWN = {
    "collision as a string": ([(SIZE, f'{SIZE}\nstring physics:collisionEnabled = "x"')], "must be of type bool"),
    "power blocked": (
        [(POWER, "double ot:trap:power = None")],
        r"/World/Trap: ot:trap:power = None \(blocked\): must be of type double, \[0, 10\], or not authored",
    ),
    "power sample blocked": (
        [(POWER, "double ot:trap:power.timeSamples = { 0: 0.1, 60: None }")],
        r"/World/Trap: ot:trap:power = a time sample None \(blocked\): must be of type double",
    ),
}

DRAWN = {
    "colour as a string": (
        [(RADIUS, f'{RADIUS}\nstring primvars:displayColor = "red"')],
        r"/World/Cell: primvars:displayColor = red \(type string\): must be of type color3f\[\]",
    ),
    "no such colour": (
        [
            (
                RADIUS,
                f"{RADIUS}\ncolor3f[] primvars:displayColor = [(1, 0, 0)]\nint[] primvars:displayColor:indices = [5]",
            )
        ],
        r"/World/Cell: primvars:displayColor:indices = 5 … 5: must be in \[0, 0\]",
    ),
}


@pytest.mark.parametrize("name", CASES | NOT_DRAWN)
def test_reading_a_scene(name: str, stage_file: StageFile, capfd: pytest.CaptureFixture[str]) -> None:
    changes, message = (CASES | NOT_DRAWN)[name]
    path = stage_file.write(*changes)
    with pytest.raises(InputError, match=message) as caught:
        Scene.load(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", [name for name in CASES | DRAWN if name != "points that move"])
def test_drawing_a_scene(name: str, stage_file: StageFile, capfd: pytest.CaptureFixture[str]) -> None:
    changes, message = (CASES | DRAWN)[name]
    with pytest.raises(InputError, match=message):
        read_drawables(stage_file.write(*changes))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("text", ["", "quath[] orientations = []\nfloat3[] scales = []\nint64[] invisibleIds = []"])
def test_an_instancer_of_empty_arrays_has_no_bodies(text: str, stage_file: StageFile) -> None:
    empty = "rel prototypes = </World/I/C>\nint[] protoIndices = []\npoint3f[] positions = []\n"
    path = stage_file.write(*instancer(text, empty))
    assert len(Scene.load(path).bodies) == len(stage_file.load().bodies)
    read_drawables(path)


def test_what_may_be_left_out_may_be_blocked(stage_file: StageFile) -> None:
    """Recorded runs block `orientationsf`, which would go before the orientations that they write."""
    text = "quatf[] orientationsf = None\nquath[] orientations = [(0, 0, 0, 1)]\nfloat3[] scales = None"
    bodies = stage_file.load(*instancer(text)).bodies
    assert [body.orientation for body in bodies if body.instance == 0] == [(0.0, 0.0, 1.0, 0.0)]


def calls_get(path: Path) -> bool:
    """Whether a file asks a USD attribute for its value: nothing else has a method of that name."""
    text = path.read_text(encoding="utf-8")
    nodes = ast.walk(ast.parse(text)) if "Get" in text else ()
    return any(isinstance(node, ast.Attribute) and node.attr == "Get" for node in nodes)


def test_there_is_one_door() -> None:
    assert [path for path in sorted(PACKAGE.rglob("*.py")) if calls_get(path)] == [UNUSED, DOOR]


SPLINE = ".spline = { 0: 1; post linear, 60: 2; post linear, }"
SLIDE = f'double xformOp:translateX{SPLINE}\n        uniform token[] xformOpOrder = ["xformOp:translateX"]'
MOVING = (
    "double3 xformOp:translate.timeSamples = { 0: (0, 0, 5), 60: (6, 0, 5) }\n"
    '        uniform token[] xformOpOrder = ["xformOp:translate"]'
)
FOLLOWED = {
    "power": ((POWER, f"double ot:trap:power{SPLINE}"), "Trap: ot:trap:power = .a spline.: must be a value, or time"),
    "aperture": (
        ("double ot:trap:numericalAperture = 1.2", f"double ot:trap:numericalAperture{SPLINE}"),
        "Trap: ot:trap:numericalAperture = .a spline.: must be constant in time",
    ),
    "radius": ((RADIUS, f"double radius{SPLINE}"), "Cell: radius = .a spline.: must be constant in time"),
    "trap": ((MOVING, SLIDE), "Trap: xformOp:translateX = .a spline.: must be a value, or time samples"),
    "above an obstacle": (
        ('def Xform "World" (prepend apiSchemas = ["OtSceneAPI"])\n{', 'def Xform "World" (prepend apiSchemas = '
         f'["OtSceneAPI"])\n{{\n{SLIDE}'),
        "World: xformOp:translateX = .a spline.: must be a value, or time samples",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", FOLLOWED)
def test_a_spline_is_refused_and_not_taken_for_a_constant(case: str, stage_file: StageFile) -> None:
    change, message = FOLLOWED[case]
    with pytest.raises(InputError, match=message):
        stage_file.load(change)


def test_a_spline_of_a_body_is_remarked_as_its_time_samples_are(stage_file: StageFile) -> None:
    remarks = stage_file.load((ORDER, SLIDE)).remarks
    assert any("/World/Cell" in str(r) and "only the place at the start counts" in str(r) for r in remarks)
