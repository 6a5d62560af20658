"""Rods of bodies: read from Capsules and Cylinders, authored back, checked, counted, weighed and drawn."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Body, Obstacle, Rod, SceneBuilder, Sphere, Track
from otwarp.scene.drawing.drawables import read_drawables
from otwarp.scene.read.validate import validate
from otwarp.simulation.info import describe
from otwarp.simulation.packing.bodies import union_volume
from tests.scene.conftest import StageFile

BALL = """        def Sphere "Ball" (prepend apiSchemas = ["OtSphereAPI"])
"""
ROD = """        def {kind} "Rod" (prepend apiSchemas = [{schemas}])
        {{
            token axis = "{axis}"
            double height = {height}
            double radius = 0.5
            {extra}
            double3 xformOp:translate = (1, 2, 3)
            float3 xformOp:scale = ({scale})
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        }}

"""
GRID = 2e-2
"""Relative error of a volume counted on 96 cells along the longest side."""


def rod(kind="Capsule", axis="X", height=4.0, scale="1, 1, 1", schemas='"OtRodAPI"', extra="") -> tuple[str, str]:
    """The change that puts a rod beside the ball of the stage's robot, which stands at (0, 0, 5)."""
    text = ROD.format(kind=kind, axis=axis, height=height, scale=scale, schemas=schemas, extra=extra)
    return BALL, text + BALL


def test_a_capsule_with_the_schema_is_a_rod(stage_file: StageFile):
    """Ends in the body's frame, whichever axis; values by default; scaled as a whole."""
    for axis, along in (("X", (1, 0, 0)), ("Y", (0, 1, 0)), ("Z", (0, 0, 1))):
        body = stage_file.load(rod(axis=axis, scale="2, 2, 2")).bodies[0]
        (found,) = body.rods
        assert (found.prim, found.radius, found.collides, found.drag) == ("/World/Robot/Rod", 1.0, True, True)
        np.testing.assert_allclose(found.start, np.array([1, 2, 3]) - 4.0 * np.array(along), atol=1e-12)
        np.testing.assert_allclose(found.end, np.array([1, 2, 3]) + 4.0 * np.array(along), atol=1e-12)
        assert body.colliding == (*body.spheres, found)


def test_flags_of_a_rod(stage_file: StageFile):
    flags = "bool ot:rod:collides = false\n            bool ot:rod:drag = false"
    body = stage_file.load(rod(extra=flags)).bodies[0]
    assert (body.rods[0].collides, body.rods[0].drag) == (False, False)
    assert body.colliding == body.spheres


def test_a_cylinder_holds_a_rod_from_end_to_end(stage_file: StageFile):
    (found,) = stage_file.load(rod("Cylinder", height=4.0)).bodies[0].rods
    np.testing.assert_allclose([found.start, found.end], [[-0.5, 2, 3], [2.5, 2, 3]], atol=1e-12)
    assert found.radius == 0.5


def test_without_the_schema_it_is_a_look(stage_file: StageFile):
    assert stage_file.load(rod(schemas='"PhysicsCollisionAPI"')).bodies[0].rods == ()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (rod("Sphere"), "must be on a Capsule or Cylinder, not a Sphere"),
        (rod(scale="1, 2, 1"), "xformOp:scale = (1, 2, 1): must be uniform on a capsule"),
        (rod("Cylinder", scale="1, 2, 1"), "must be equal across the axis of a cylinder"),
        (rod("Cylinder", height=0.8), "height = 0.8: must be 1 stage units or more, twice the radius, on a rod"),
        (rod(height=-1.0), "height = -1.0: must be in [0, inf)"),
        (rod(extra="bool ot:rod:colides = true"), "did you mean ot:rod:collides?"),
        (rod(extra="double ot:rod:drag = 1"), "must be of type bool"),
    ],
    ids=["sphere", "scaled", "cylinder scaled", "short", "negative", "misspelt", "type"],
)
def test_bad_rods_are_refused_in_one_line(change, message, stage_file: StageFile):
    with pytest.raises(InputError) as error:
        stage_file.load(change)
    text = str(error.value)
    assert "/World/Robot/Rod" in text
    assert message in text
    assert "\n" not in text


def test_a_rod_outside_a_body_is_refused(stage_file: StageFile):
    outside = ('    def Sphere "Cell"', ROD.format(kind="Capsule", axis="X", height=1, scale="1, 1, 1",
               schemas='"OtRodAPI"', extra="") + '    def Sphere "Cell"')  # fmt: skip
    with pytest.raises(InputError, match="/World/Rod: apiSchemas = OtRodAPI: must be below a prim with OtBodyAPI"):
        stage_file.load(outside)


def robot(**more) -> Body:
    ball = Sphere(prim="/World/R/Ball", radius=1.0)
    rods = (
        Rod(prim="/World/R/Arm", start=(0.5, 0.0, 0.0), end=(5.0, 1.0, -2.0), radius=0.4),
        Rod(prim="/World/R/Tail", start=(0.0, 0.0, 0.0), end=(0.0, -3.0, 0.0), radius=0.2, collides=False, drag=False),
    )
    return Body(prim="/World/R", position=(1.0, 2.0, 9.0), spheres=(ball,), rods=rods, **more)


def test_rods_are_authored_back_drawn_validated_and_counted(tmp_path):
    builder = SceneBuilder()
    builder.add(robot())
    builder.add_light("/World/Light")
    builder.add_view("/World/View", (0, -30, 20), (0, 0, 8))
    path = builder.save(tmp_path / "rods.usda")
    (body,) = builder.scene().bodies
    for found, wanted in zip(body.rods, robot().rods, strict=True):
        np.testing.assert_allclose([found.start, found.end], [wanted.start, wanted.end], atol=1e-8)  # nine decimals
        assert dataclasses.replace(found, start=wanted.start, end=wanted.end) == wanted
    assert len(read_drawables(path)) == 3
    assert validate(path).ok
    (row,) = describe(builder.scene(), device="cpu")["bodies"]
    assert (row["spheres"], row["rods"], row["colliding"]) == (1, 2, 2)


def test_a_rod_elsewhere_than_below_its_body_is_refused():
    lost = dataclasses.replace(robot(), rods=(Rod(prim="/World/X", start=(0, 0, 0), end=(1, 0, 0), radius=0.1),))
    with pytest.raises(InputError, match="path = /World/X: must be below its body /World/R"):
        SceneBuilder().add(lost)


def test_rods_may_not_start_inside_obstacles():
    """The ball is clear of the block; the arm's middle runs through its edge."""
    block = Obstacle(prim="/World/Block", shape="box", position=Track.constant((4.0, 2.5, 7.5)),
                     orientation=Track.constant((0.0, 0.0, 0.0, 1.0)), size=(0.3, 0.3, 0.3))  # fmt: skip
    builder = SceneBuilder()
    builder.add(robot())
    builder.add(block)
    with pytest.raises(InputError, match="/World/R: overlap with /World/Block"):
        builder.scene()


def test_the_volume_of_a_capsule_is_counted():
    """A rod that contains its sphere: π r² L + 4/3 π r³, centroid in its middle; equal to the sphere at length 0."""
    ball = Sphere(prim="/World/A/S", offset=(1.0, 0.0, 0.0), radius=0.5)
    long = Rod(prim="/World/A/R", start=(1.0, 0.0, 0.0), end=(1.0, 3.0, 4.0), radius=0.5)
    volume, centroid = union_volume(Body(prim="/World/A", spheres=(ball,), rods=(long,)))
    assert volume == pytest.approx(np.pi * 0.25 * 5.0 + 4.0 / 3.0 * np.pi * 0.125, rel=GRID)
    np.testing.assert_allclose(centroid, [1.0, 1.5, 2.0], atol=0.02)
    short = dataclasses.replace(long, end=long.start)
    volume, centroid = union_volume(Body(prim="/World/A", spheres=(ball,), rods=(short,)))
    assert volume == pytest.approx(4.0 / 3.0 * np.pi * 0.125, rel=GRID)
