"""What is allowed and hardly meant: each case draws its warning, and a neighbouring good value draws none."""

from __future__ import annotations

import dataclasses
import re
import warnings

import pytest

from otwarp.errors import InputError, PlausibilityWarning
from otwarp.scene import Medium, Scene
from otwarp.scene.plausibility import judge
from otwarp.simulation.model import Model
from tests.scene.conftest import STAGE, StageFile

Changes = list[tuple[str, str]]

GOOD = STAGE.replace("translate = (10, 0, 5)", "translate = (4.8, 0, 5)")
"""The stage of these tests with its cell between its robots, where the task can begin."""

INDEX = "double ot:medium:refractiveIndex = 1.33"
STIFF = "stiffness = 2\n"
SPEED = "double ot:flow:speed = 3e-5"
MOVES = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 5), 60: (6, 0, 5) }"
RATE = "    metersPerUnit = 1e-6\n    startTimeCode = 0\n    timeCodesPerSecond = 60\n"
BODY = "double3 xformOp:translate = (0, 0, 5)"
BLOCK = STAGE[STAGE.index('    def Cube "Block"') : STAGE.index('    def Xform "Flow"')]
TRAP = STAGE[STAGE.index('    def Xform "Trap"') : STAGE.index('    def Xform "Robot"')]
CELL = "double3 xformOp:translate = (4.8, 0, 5)"
ROBOT_OPS = f'{BODY}\n        uniform token[] xformOpOrder = ["xformOp:translate"]\n\n        def Sphere'


def medium(text: str) -> Changes:
    return [(INDEX, f"{INDEX}\n    {text}")]


def law(text: str) -> Changes:
    return [(STIFF, f"{STIFF}        double ot:trapLaw:isotropic:{text}\n")]


def path(samples: str) -> Changes:
    return [(MOVES, f"double3 xformOp:translate.timeSamples = {{ {samples} }}")]


def wall(shape: str, place: str) -> Changes:
    text = f'    def {shape} "Block" (prepend apiSchemas = ["PhysicsCollisionAPI"])\n    {{\n{place}\n    }}\n\n'
    return [(BLOCK, text)]


def at(x: float, y: float, z: float) -> str:
    move = f"        double3 xformOp:translate = ({x}, {y}, {z})"
    return f'{move}\n        uniform token[] xformOpOrder = ["xformOp:translate"]'


def tetrahedron(faces: str, extra: str = "") -> Changes:
    """A small mesh far off; its outward faces are (0 2 1) (0 1 3) (1 2 3) (0 3 2)."""
    corners = faces.count(",") + 1
    counts = ", ".join(["3"] * (corners // 3))
    points = "(0, 0, 0), (2, 0, 0), (0, 2, 0), (0, 0, 2)"
    lines = f"point3f[] points = [{points}]\nint[] faceVertexCounts = [{counts}]\nint[] faceVertexIndices = [{faces}]"
    return wall("Mesh", f"{lines}\n{extra}\n{at(30, 0, 1)}")


def second_trap(place: str) -> Changes:
    moved = TRAP.replace('"Trap"', '"Other"').replace(MOVES, f"double3 xformOp:translate = {place}")
    return [(TRAP, TRAP + moved)]


CLOSED = "0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2"
INWARD = "0, 1, 2, 0, 3, 1, 1, 3, 2, 0, 2, 3"
OPEN = "0, 2, 1, 0, 1, 3, 1, 2, 3"

# name: what to change, what the warning must say of which prim, and a change beside it that is good
CASES: dict[str, tuple[Changes, str, Changes]] = {
    "viscosity in mPa·s": (
        medium("double ot:medium:viscosity = 0.89"),
        r"/World: ot:medium:viscosity = 0.89 Pa·s, 1e\+03 × that of water; usual: 0.0002 … 0.1 Pa·s; "
        r"did you mean 0.89 mPa·s, which is 0.00089 Pa·s\?",
        medium("double ot:medium:viscosity = 0.00089"),
    ),
    "temperature in °C": (
        medium("double ot:medium:temperature = 25"),
        r"/World: ot:medium:temperature = 25 K; usual: 250 … 400 K; did you mean 25 °C, which is 298.15 K\?",
        medium("double ot:medium:temperature = 298.15"),
    ),
    "stiffness in pN/µm": (
        [(STIFF, "stiffness = 20\n"), ("lengthUnit = 1e-6", "lengthUnit = 1"), ("forceUnit = 1e-12", "forceUnit = 1")],
        r"/World/Trap: ot:trapLaw:isotropic:stiffness = 20 N/m \(2e\+07 pN/µm\); usual: .* did you mean 20 pN/µm, "
        r"which is 2e-05 N/m\?",
        [
            (STIFF, "stiffness = 2e-5\n"),
            ("lengthUnit = 1e-6", "lengthUnit = 1"),
            ("forceUnit = 1e-12", "forceUnit = 1"),
        ],
    ),
    "cut-off in m": (
        law("cutoff = 3e6"),
        r"/World/Trap: ot:trapLaw:isotropic:cutoff = 3 m \(3e\+06 µm\); usual: 0.01 … 1000 µm; did you mean 3 µm",
        law("cutoff = 3"),
    ),
    "flow in µm/s": (
        [(SPEED, "double ot:flow:speed = 5")],
        r"/World/Flow: ot:flow:speed = 5 m/s \(5e\+06 µm/s\); usual: .*; did you mean 5 µm/s, which is 5e-06 m/s\?",
        [(SPEED, "double ot:flow:speed = -5e-6")],
    ),
    "power in mW": (
        [("double ot:trap:power = 0.03", "double ot:trap:power = 5")],
        r"/World/Trap: ot:trap:power = 5 W \(5000 mW\); usual: 0.001 … 3000 mW; did you mean 5 mW",
        [("double ot:trap:power = 0.03", "double ot:trap:power = 5e-3")],
    ),
    "centimetres": (
        [("metersPerUnit = 1e-6", "metersPerUnit = 0.01")],
        r"/World/Robot/Ball: radius = 15000 µm; usual: 0.01 … 500 µm; did you mean 1.5 µm\? metersPerUnit is 1e-6 .* "
        r"0.01 where they are in cm \(and 1 more\)",
        [("metersPerUnit = 1e-6", "metersPerUnit = 1e-6")],
    ),
    "geometry in metres": (
        [("double radius = 3", "double radius = 3e-6")],
        r"/World/Cell: radius = 3e-06 µm; .* did you mean 3 µm\? lengths of geometry are in stage units",
        [("double radius = 3", "double radius = 2.9")],
    ),
    "modulus in GPa": (
        [("double radius = 3", "double radius = 3\n        double ot:cell:youngsModulus = 3")],
        r"/World/Cell: ot:cell:youngsModulus = 3 Pa; usual: .*; did you mean 3 kPa, which is 3000 Pa\?",
        [("double radius = 3", "double radius = 3\n        double ot:cell:youngsModulus = 3e3")],
    ),
    "goal in µm": (
        [("rel ot:goal:cell =", "double ot:goal:tolerance = 5\n        rel ot:goal:cell =")],
        r"/World/Goal: ot:goal:tolerance = 5 m .* did you mean 5 µm",
        [("rel ot:goal:cell =", "double ot:goal:tolerance = 5e-6\n        rel ot:goal:cell =")],
    ),
    "a milliard frames": (
        [("framesPerSecond = 30", "framesPerSecond = 1e9")],
        r"/: framesPerSecond = 1e\+09 1/s; usual: 0.1 … 100000 1/s",
        [("framesPerSecond = 30", "framesPerSecond = 1000")],
    ),
    "op that is not listed": (
        [(ROBOT_OPS, ROBOT_OPS.replace("        uniform", "        float xformOp:rotateX = 90\n        uniform"))],
        r"/World/Robot: xformOp:rotateX has no effect: xformOpOrder does not name it",
        [
            (
                ROBOT_OPS,
                ROBOT_OPS.replace("        uniform", "        float xformOp:rotateX = 90\n        uniform").replace(
                    '"]', '", "xformOp:rotateX"]'
                ),
            )
        ],
    ),
    "op without an order": (
        [
            (
                f'{BODY}\n        uniform token[] xformOpOrder = ["xformOp:translate"]',
                "double3 xformOp:translate = (0, 0, 5)",
            )
        ],
        r"/World/Robot: xformOp:translate has no effect: xformOpOrder does not name it",
        [],
    ),
    "robot with time samples": (
        [(BODY, "double3 xformOp:translate.timeSamples = { 0: (0, 0, 5), 60: (9, 0, 5) }")],
        r"/World/Robot: time samples of the transform are not played: only the place at the start counts",
        [(BODY, "double3 xformOp:translate.timeSamples = { 0: (0, 0, 5) }")],
    ),
    "trap on nothing": (
        [*law("cutoff = 2"), *path("0: (0, 30, 5), 60: (6, 30, 5)"), ("rel ot:trap:holds = </World/Robot/Ball>", "")],
        r"/World/Trap: no sphere comes within its reach of 2 µm: the nearest starts 30 µm away",
        [*law("cutoff = 2"), *path("0: (0, 1.5, 5), 60: (0, 30, 5)"), ("rel ot:trap:holds = </World/Robot/Ball>", "")],
    ),
    "trap far from what it names": (
        [*law("cutoff = 2"), *path("0: (0, 4, 5), 60: (0, 0, 5)")],
        r"/World/Trap: starts 4 µm from the sphere that it holds; usual: within 2 µm",
        [*law("cutoff = 2"), *path("0: (0, 1.9, 5), 60: (0, 0, 5)")],
    ),
    "spring from afar": (
        path("0: (0, 40, 5), 60: (0, 0, 5)"),
        r"/World/Trap: starts 40 µm from the sphere .* within 6.63 µm; a force curve without a cutoff pulls from every",
        path("0: (0, 4, 5), 60: (0, 0, 5)"),
    ),
    "nothing is trapped": (
        [
            ("double ot:sphere:refr", "bool ot:sphere:trapped = false\n double ot:sphere:refr"),
            ("rel ot:trap:holds = </World/Robot/Ball>", ""),
        ],
        r"/World/Trap: acts on nothing: the scene has no sphere that traps act on",
        [("double ot:sphere:refr", "bool ot:sphere:trapped = true\n double ot:sphere:refr")],
    ),
    "two traps far apart": (
        second_trap("(-5, 0, 5)"),
        r"/World/Other: holds the same sphere as /World/Trap, 5 µm away; usual: within 4.06 µm",
        second_trap("(-1, 0, 5)"),
    ),
    "trap below the floor": (
        [*wall("Plane", at(0, 0, 0.9)), *path("0: (0, 0, 5), 30: (0, 0, 5), 60: (0, 0, 0.5)")],
        r"/World/Trap: its focus is inside /World/Block, 0.4 µm deep, at 1 s",
        [*wall("Plane", at(0, 0, 0.4)), *path("0: (0, 0, 5), 30: (0, 0, 5), 60: (0, 0, 0.5)")],
    ),
    "trap that leaps": (
        [*law("cutoff = 2"), *path("0: (0, 0, 5), 30: (3, 0, 5), 31: (60, 0, 5), 60: (60, 0, 5)")],
        r"/World/Trap: leaps 57 µm from 0.5 s to 0.5167 s, 3.42e\+03 µm/s; its sphere follows at \d+ µm/s at most "
        r"and is held up to 2 µm",
        [*law("cutoff = 2"), *path("0: (0, 0, 5), 30: (3, 0, 5), 31: (4.5, 0, 5), 60: (60, 0, 5)")],
    ),
    "faces without area": (
        tetrahedron(f"{CLOSED}, 0, 1, 1"),
        r"/World/Block: 1 of 5 triangles of the mesh have no area, the first is number 4",
        tetrahedron(CLOSED),
    ),
    "open mesh": (
        tetrahedron(OPEN),
        r"/World/Block: the mesh is not closed, hence a thin sheet, solid from both sides; doubleSided = 1 says so",
        tetrahedron(OPEN, "uniform bool doubleSided = 1"),
    ),
    "mesh inside out": (
        tetrahedron(INWARD),
        r"/World/Block: the faces of the mesh look inwards, .* 2 of 2 bodies start outside",
        tetrahedron(INWARD, 'uniform token orientation = "leftHanded"'),
    ),
    "cell lost": (
        [(CELL, "double3 xformOp:translate = (10, 0, 5)")],
        r"/World/Goal: the task is lost at t = 0: /World/Cell starts 10 µm from the midpoint of its robots; "
        r"ot:goal:cellLostDistance is 5 µm",
        [(CELL, "double3 xformOp:translate = (4.9, 0, 5)")],
    ),
    "robot lost": (
        path("0: (0, 6, 5), 60: (0, 0, 5)"),
        r"/World/Goal: the task is lost at t = 0: /World/Trap starts 6 µm from its sphere; ot:goal:lost.* is 5 µm",
        path("0: (0, 4, 5), 60: (0, 0, 5)"),
    ),
    "robot in the dark": (
        [("double ot:trap:power = 0.03", "double ot:trap:power.timeSamples = { 0: 0, 60: 0.03 }")],
        r"/World/Goal: the task is lost at t = 0: all traps of /World/Robot are dark",
        [("double ot:trap:power = 0.03", "double ot:trap:power.timeSamples = { 0: 0.01, 60: 0 }")],
    ),
    "robot that nothing holds": (
        [(TRAP, "")],
        r"/World/Goal: no trap holds /World/Robot at t = 0, which is to carry /World/Cell",
        [],
    ),
    "delivered": (
        [("translate = (40, 0, 5)", "translate = (5, 0, 5)")],
        r"/World/Goal: the task is delivered at t = 0: /World/Cell starts 0.2 µm from the goal, tolerance 1 µm",
        [("translate = (40, 0, 5)", "translate = (6, 0, 5)")],
    ),
    "goal in a wall": (
        [("translate = (40, 0, 5)", "translate = (20, 0, 1)")],
        r"/World/Goal: /World/Cell cannot come within 1 µm of the goal: /World/Block is around it, .* radius is 3 µm",
        [("translate = (40, 0, 5)", "translate = (20, 0, 4)")],
    ),
}


def said(scene: Scene) -> list[str]:
    return [f"{finding.prim}: {finding.message}" for finding in judge(scene)]


def test_the_stage_itself_draws_no_warning(stage_file: StageFile) -> None:
    assert said(stage_file.load(text=GOOD)) == []


@pytest.mark.parametrize("name", CASES)
def test_a_slip_is_told_and_its_neighbour_is_not(name: str, stage_file: StageFile) -> None:
    slip, pattern, good = CASES[name]
    found = said(stage_file.load(*slip, text=GOOD))
    assert any(re.match(pattern, text) for text in found), found
    assert said(stage_file.load(*good, text=GOOD)) == []


FLOW = 'token ot:flow:kind = "poiseuille"'


def scaled(scale: str) -> str:
    """A scale of a prim, and its order of ops."""
    return f'float3 xformOp:scale = {scale}\n        uniform token[] xformOpOrder = ["xformOp:scale"]\n'


def microscope(scale: str) -> Changes:
    """One under a scale."""
    camera = f'    def Camera "Odd" (prepend apiSchemas = ["OtCameraAPI"])\n    {{\n        {scaled(scale)}    }}\n\n'
    return [(BLOCK, BLOCK + camera)]


REFUSED: dict[str, tuple[Changes, str, Changes]] = {
    "mirrored robot": (
        [
            (
                ROBOT_OPS,
                ROBOT_OPS.replace(
                    "        uniform", "        float3 xformOp:scale = (-1, 1, 1)\n        uniform"
                ).replace('"]', '", "xformOp:scale"]'),
            )
        ],
        r"/World/Robot: xformOp:scale = \(-1, 1, 1\), mirrored: must be no reflection on a body",
        [
            (
                ROBOT_OPS,
                ROBOT_OPS.replace(
                    "        uniform", "        float3 xformOp:scale = (-1, -1, 1)\n        uniform"
                ).replace('"]', '", "xformOp:scale"]'),
            )
        ],
    ),
    "mirrored flow": (
        [(FLOW, scaled("(-1, 1, 1)") + FLOW)],
        r"/World/Flow: xformOp:scale = \(-1, 1, 1\), mirrored: must be no reflection of the prim or above it; turn it",
        [(FLOW, scaled("(-1, -1, 1)") + FLOW)],
    ),
    "mirrored microscope": (
        microscope("(1, 1, -1)"),
        r"/World/Odd: xformOp:scale = \(.*\), mirrored: must be no reflection",
        microscope("(2, 2, 2)"),
    ),
    "op that is not there": (
        [(ROBOT_OPS, ROBOT_OPS.replace('"]', '", "xformOp:rotateX"]'))],
        r"/World/Robot: xformOp:rotateX = \(absent\): must be of type",
        [],
    ),
    "camera without a focal length": (
        [(BLOCK, BLOCK + '    def Camera "View" {\n    float focalLength = 0\n    }\n')],
        r"/World/View: focalLength = 0.0: must be in \(0, inf\)",
        [(BLOCK, BLOCK + '    def Camera "View" {\n    float focalLength = 35\n    }\n')],
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_nonsense_is_refused(name: str, stage_file: StageFile) -> None:
    slip, pattern, good = REFUSED[name]
    with pytest.raises(InputError, match=pattern):
        stage_file.load(*slip, text=GOOD)
    assert said(stage_file.load(*good, text=GOOD)) == []


def test_the_order_of_samples_in_a_file_has_no_meaning(stage_file: StageFile) -> None:
    forth, back = "0: (0, 0, 5), 60: (6, 0, 5)", "60: (6, 0, 5), 0: (0, 0, 5)"
    assert stage_file.load(*path(back), text=GOOD) == stage_file.load(*path(forth), text=GOOD)


def test_what_is_built_in_python_is_judged_alike(stage_file: StageFile) -> None:
    built = dataclasses.replace(stage_file.load(text=GOOD), file=None, medium=Medium(temperature=25.0, viscosity=0.89))
    changes = medium("double ot:medium:temperature = 25\n    double ot:medium:viscosity = 0.89")
    assert said(built) == said(stage_file.load(*changes, text=GOOD)) and len(said(built)) == 2


def test_a_part_of_a_scene_is_not_judged_again(stage_file: StageFile, device: str) -> None:
    scene = dataclasses.replace(stage_file.load(*CASES["temperature in °C"][0], text=GOOD), judged=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Model.build(scene, device=device).authored is scene


def test_a_simulation_says_it_once(stage_file: StageFile, device: str) -> None:
    scene = stage_file.load(*CASES["temperature in °C"][0], text=GOOD)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for _ in range(2):
            Model.build(scene, device=device)
    (only,) = (str(w.message) for w in caught if w.category is PlausibilityWarning)
    assert only.startswith(
        f"{scene.file}: /World: ot:medium:temperature = 25 K; usual: 250 … 400 K; did you mean 25 °C"
    )
