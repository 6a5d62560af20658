"""Moving prims: what lies between time samples is what USD's transform ops say, not a straight line."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import UsdGeom

from otwarp.errors import InputError
from otwarp.scene import Obstacle
from otwarp.scene.read.motion import CHORD, LARGEST_TURN, TURN_ERROR
from otwarp.scene.read.source import open_stage
from otwarp.scene.transforms import rotation_matrix
from tests.scene.conftest import STAGE, StageFile

BLOCK = STAGE[STAGE.index('    def Cube "Block"') : STAGE.index('    def Xform "Flow"')]

ARM = """    def Xform "Arm"
    {{
        {ops}
        def Cube "Block" (prepend apiSchemas = ["PhysicsCollisionAPI"])
        {{
            double size = 1
            double3 xformOp:translate = (20, 0, 100)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}
    }}

"""

OPS = {
    "90 degrees": ("rotateZ", "double xformOp:rotateZ.timeSamples = { 0: 0, 60: 90 }"),
    "270 degrees": ("rotateZ", "double xformOp:rotateZ.timeSamples = { 0: 0, 60: 270 }"),
    "one turn": ("rotateZ", "double xformOp:rotateZ.timeSamples = { 0: 0, 60: 360 }"),
    "two turns back": ("rotateZ", "double xformOp:rotateZ.timeSamples = { 0: 0, 60: -720 }"),
    "three angles": (
        "rotateXYZ",
        "double3 xformOp:rotateXYZ.timeSamples = { 0: (0, 10, 0), 30: (170, 60, -90), 60: (0, 0, 180) }",
    ),
    "quaternions and translation": (
        'translate", "xformOp:orient',
        "quatd xformOp:orient.timeSamples = { 0: (1, 0, 0, 0), 60: (0, 0.6, 0, 0.8) }\n"
        "        double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 15: (5, 0, 0), 60: (0, 9, 0) }",
    ),
}
OPS = {k: f'{text}\n        uniform token[] xformOpOrder = ["xformOp:{op}"]' for k, (op, text) in OPS.items()}


def arm(stage_file: StageFile, ops: str) -> Obstacle:
    return stage_file.load((BLOCK, ARM.format(ops=ops))).obstacles[0]


@pytest.mark.parametrize("ops", OPS.values(), ids=OPS)
def test_a_prim_on_a_turning_parent_goes_where_usd_puts_it(stage_file: StageFile, ops: str) -> None:
    found = arm(stage_file, ops)
    stage = open_stage(stage_file.folder / "scene.usda")
    for code in np.linspace(0.0, 60.0, 97):
        matrix = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(stage.GetPrimAtPath("/World/Arm/Block")))
        # halving ends when the middle is this close; the worst point of a curve is hardly worse than its middle
        assert np.linalg.norm(found.position.at(code / 60.0) - matrix[3, :3]) < 1.5 * CHORD
        turn = found.orientation.at(code / 60.0)
        turn /= np.linalg.norm(turn)
        assert rotation_matrix(turn) == pytest.approx(matrix[:3, :3].T, abs=4.0 * TURN_ERROR)
    steps = np.abs((found.orientation.values[1:] * found.orientation.values[:-1]).sum(axis=1))
    assert np.degrees(2.0 * np.arccos(steps.min().clip(0.0, 1.0))) < 1.01 * LARGEST_TURN
    assert np.array_equal(found.position.times, found.orientation.times)


def test_halfway_through_a_quarter_turn_an_arm_points_along_the_diagonal(stage_file: StageFile) -> None:
    found = arm(stage_file, OPS["90 degrees"])
    assert found.position.at(0.5) == pytest.approx([20 * np.sqrt(0.5), 20 * np.sqrt(0.5), 100.0], abs=1.5 * CHORD)


def test_motion_without_rotation_keeps_the_authored_samples(stage_file: StageFile) -> None:
    still = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 45: (3, 0, 1), 60: (0, 4, 0) }\n"
    still += (
        '        double xformOp:rotateZ = 30\nuniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]'
    )
    assert arm(stage_file, still).position.times.tolist() == [0.0, 0.75, 1.0]


def test_a_solid_keeps_its_size_between_the_samples_of_a_matrix(stage_file: StageFile) -> None:
    turned = "( (0, 2, 0, 0), (-2, 0, 0, 0), (0, 0, 2, 0), (0, 0, 0, 1) )"
    start = "( (2, 0, 0, 0), (0, 2, 0, 0), (0, 0, 2, 0), (0, 0, 0, 1) )"
    ops = f"matrix4d xformOp:transform.timeSamples = {{ 0: {start}, 60: {turned} }}\n"
    found = arm(stage_file, ops + '        uniform token[] xformOpOrder = ["xformOp:transform"]')
    assert found.size == pytest.approx((1.0, 1.0, 1.0))
    half = found.orientation.at(0.5)
    expected = [0.0, 0.0, np.sin(np.pi / 8), np.cos(np.pi / 8)]
    assert half / np.linalg.norm(half) == pytest.approx(expected, abs=TURN_ERROR)


def test_a_trap_that_turns_between_its_samples_is_refused(stage_file: StageFile) -> None:
    order = 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    turning = "double xformOp:rotateX.timeSamples = { 0: 0, 60: 360 }\n        "
    turning += 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]'
    with pytest.raises(InputError, match="a trap may move, not turn"):
        stage_file.load((order, turning))
