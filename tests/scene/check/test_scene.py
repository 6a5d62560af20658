"""What is built in Python is held to what files are held to, by the same code; each case has a good neighbour."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.scene import (
    Body,
    Camera,
    Flow,
    Goal,
    Material,
    Medium,
    Obstacle,
    Rod,
    Scene,
    SceneBuilder,
    Settings,
    Sphere,
    Track,
    Trap,
)
from otwarp.simulation import Model
from tests.scene.conftest import StageFile

NAN = float("nan")
BALL = Sphere(prim="/World/B/S", radius=1.0)
ROD = Rod(prim="/World/B/R", start=(0.0, 0.0, 0.0), end=(1.0, 0.0, 0.0), radius=0.2)
BODY = Body(prim="/World/B", spheres=(BALL,), rods=(ROD,))
CELL = Body(prim="/World/C", kind="cell", position=(9.0, 0.0, 0.0), spheres=(Sphere(prim="/World/C", radius=2.0),))
LAW = TrapLaw(stiffness=10.0, cutoff=2.0)
STILL, TURN = Track.constant((0.0, 0.0, 0.0)), Track.constant((0.0, 0.0, 0.0, 1.0))
TRAP = Trap(prim="/World/T", position=STILL, power=Track.constant(20.0), radial=LAW)
FLOOR = Obstacle(prim="/World/F", shape="plane", position=Track.constant((0.0, 0.0, -9.0)), orientation=TURN)
SHEET = Obstacle(
    prim="/World/M",
    shape="mesh",
    position=Track.constant((0.0, 0.0, -90.0)),
    orientation=TURN,
    vertices=np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    triangles=np.array([[0, 1, 2]]),
)
GOAL = Goal(
    prim="/World/G",
    position=(40.0, 0.0, 0.0),
    cell=CELL.prim,
    robots=(BODY.prim,),
    tolerance=1.0,
    lost_distance=5.0,
    cell_lost_distance=5.0,
    distance_warning=2.0,
)
GOOD = Scene(
    bodies=(BODY, CELL),
    traps=(TRAP,),
    obstacles=(FLOOR, SHEET),
    flow=Flow(prim="/World/W", kind="uniform", speed=3.0),
    camera=Camera(prim="/World/K"),
    goal=GOAL,
)


def body(**changed: Any) -> dict[str, Any]:
    return {"bodies": (dataclasses.replace(BODY, **changed), CELL)}


def ball(**changed: Any) -> dict[str, Any]:
    return body(spheres=(dataclasses.replace(BALL, **changed),))


def trap(**changed: Any) -> dict[str, Any]:
    return {"traps": (dataclasses.replace(TRAP, **changed),)}


def floor(**changed: Any) -> dict[str, Any]:
    return {"obstacles": (dataclasses.replace(FLOOR, **changed), SHEET)}


def sheet(**changed: Any) -> dict[str, Any]:
    return {"obstacles": (FLOOR, dataclasses.replace(SHEET, **changed))}


CASES: dict[str, tuple[dict[str, Any], str]] = {
    "viscosity": ({"medium": Medium(viscosity=NAN)}, r"/World: ot:medium:viscosity = nan: must be in \(0, 1000\] Pa·s"),
    "text": ({"medium": Medium(viscosity="thin")}, r"ot:medium:viscosity = 'thin' \(a str\): must be in \(0, 1000\]"),  # type: ignore[arg-type]
    "truth": ({"medium": Medium(density=True)}, r"ot:medium:density = True \(a bool\): must be in"),
    "no medium": ({"medium": None}, "/World: medium = None: must be of class Medium"),
    "gravity": ({"settings": Settings(gravity="no")}, r"ot:scene:gravity = 'no' \(a str\): must be true or false"),  # type: ignore[arg-type]
    "duration": ({"settings": Settings(duration=-1.0)}, r"/World: duration = -1.0: must be in \(0, inf\)"),
    "rate": ({"settings": Settings(frames_per_second=math.inf)}, "/World: frames_per_second = inf: must be in"),
    "place": (body(position=(0.0, NAN, 0.0)), r"/World/B: position\[1\] = nan: must be finite"),
    "place of two": (body(position=(0.0, 0.0)), r"/World/B: position = \(0.0, 0.0\) \(a tuple\): must be 3 numbers"),
    "place far away": (
        body(position=(2e9, 0.0, 0.0)),
        r"/World/B: position = 2e\+09 µm from the origin: must be within",
    ),
    "no rotation": (body(orientation=(0.0, 0.0, 0.0, 0.0)), r"/World/B: orientation = .*: must be a quaternion"),
    "half a rotation": (body(orientation=(1.0, 0.0, 0.0, 1.0)), r"/World/B: orientation = .*: must be a quaternion"),
    "kind": (body(kind="bacterium"), "/World/B: kind = 'bacterium': must be one of robot, cell"),
    "no sphere": (body(spheres=()), r"/World/B: spheres = \(\): must be at least one Sphere"),
    "density": (body(density=-1e-12), r"/World/B: ot:body:density = -1.0: must be in \[0, 30000\] kg/m³"),
    "modulus": (body(material=Material(youngs_modulus=0.0)), "ot:body:youngsModulus = 0.0: must be in"),
    "mobility": (body(mobility=(1.0, 2.0)), "ot:body:mobility = .*: must be 36 finite numbers or none"),
    "force": (
        body(forces={"external_force": (1.0, NAN, 0.0)}),
        r"ot:body:externalForce = .*: must be 3 finite numbers",
    ),
    "radius": (ball(radius=NAN), r"/World/B/S: radius = nan: must be in \[1e-30, 1e\+09\] µm"),
    "radius of an array": (ball(radius=np.ones(2)), r"/World/B/S: radius = array.*: must be in \[1e-30, 1e\+09\] µm"),
    "offset": (ball(offset=(0.0, 0.0, "up")), r"/World/B/S: offset = .*: must be 3 numbers"),
    "index": (ball(refractive_index=0.5), r"/World/B/S: ot:sphere:refractiveIndex = 0.5: must be in \[1, 5\]"),
    "rod": (
        body(rods=(dataclasses.replace(ROD, radius=-1.0),)),
        r"/World/B/R: radius = -1.0: must be in \[1e-30, 1e\+09\]",
    ),
    "a bead inside a bead": (
        {"bodies": (BODY, dataclasses.replace(CELL, position=(0.5, 0.0, 0.0)))},
        "/World/C: overlap with /World/B = 2.15455 µm: must be at most 0.38 µm at the start",
    ),
    "a bead inside the floor": (
        floor(position=Track.constant((0.0, 0.0, 5.0))),
        "/World/B: overlap with /World/F = 5.2 µm: must be at most 0.38 µm at the start",
    ),
    "two of a name": ({"bodies": (BODY, CELL, dataclasses.replace(BODY, position=(0, 0, 9)))}, "prim = 2 bodies: must"),
    "trap of a place": (
        trap(position=(0.0, 0.0, 5.0)),
        "/World/T: position = .*: must be a Track of 3 numbers a sample",
    ),
    "power of a place": (trap(power=STILL), "/World/T: power = samples of 3 numbers: must be a Track of 1 number"),
    "power": (trap(power=Track.constant(-1.0)), r"/World/T: ot:trap:power = -0.001: must be in \[0, 10\] W"),
    "aperture": (trap(numerical_aperture=1.4), r"ot:trap:numericalAperture = 1.4: must be in \(0, 1.33\), below"),
    "depth": (trap(depth=3.0), "/World/T: ot:trap:depth = 3e-06: must be 0 m while ot:trap:glassIndex = 0"),
    "charge": (trap(charge=1.5), r"/World/T: ot:trap:charge = 1.5 \(a float\): must be a whole number in \[-20, 20\]"),
    "hand": (trap(hand="both"), "/World/T: ot:trap:hand = both: must be one of none, left, right"),
    "law": (trap(radial=TrapLaw(stiffness=NAN)), "/World/T: ot:trapLaw:isotropic:stiffness = nan: must be in"),
    "no law": (trap(radial=None), "/World/T: radial = None: must be a TrapLaw with ot:trap:model = piecewise"),
    "holds": (trap(holds="/World/X"), "/World/T: ot:trap:holds = /World/X: must be a sphere of a body"),
    "shape": (floor(shape="blob"), "/World/F: shape = 'blob': must be one of plane, box"),
    "size": (floor(shape="box", size=(1.0, 0.0, 1.0)), r"/World/F: size\[1\] = 0.0: must be in \[1e-30, 1e\+09\] µm"),
    "hydrodynamic": (sheet(hydrodynamic=True), "ot:obstacle:hydrodynamic = True: must be false on a Mesh"),
    "vertices": (sheet(vertices=np.zeros((3, 2))), "/World/M: vertices = .*: must be n × 3 numbers"),
    "triangles": (sheet(triangles=np.array([[0, 1, 3]])), r"/World/M: triangles = 0 … 3: must be in \[0, 2\]"),
    "corners": (sheet(triangles=np.array([[0.0, 1.0, 2.0]])), "/World/M: triangles = 1 of type float64: must be whole"),
    "flow": (
        {"flow": Flow(prim="/World/W", kind="poiseuille")},
        r"ot:flow:halfHeight = 0.0: must be in \(0, inf\) m for",
    ),
    "camera": ({"camera": Camera(prim="/World/K", pixel_size=0.0)}, r"ot:camera:pixelSize = 0.0: must be in \(0, "),
    "goal": ({"goal": dataclasses.replace(GOAL, cell="/World/T")}, "ot:goal:cell = /World/T: must be one prim with"),
    "robots": ({"goal": dataclasses.replace(GOAL, robots=())}, r"ot:goal:robots = \(no target\): must be prims with"),
    "no trap": ({"traps": (BODY,)}, "/World: traps = Body.*: must be of class Trap"),
}


def test_a_robot_may_be_what_is_delivered_if_it_is_alone() -> None:
    dataclasses.replace(GOOD, goal=dataclasses.replace(GOAL, cell=BODY.prim)).check()
    other = dataclasses.replace(
        BODY, prim="/World/B2", position=(0.0, 60.0, 0.0), spheres=(dataclasses.replace(BALL, prim="/World/B2/S"),)
    )
    goal = dataclasses.replace(GOAL, cell=BODY.prim, robots=(BODY.prim, other.prim))
    with pytest.raises(InputError, match="or the only robot of ot:goal:robots"):
        dataclasses.replace(GOOD, bodies=(BODY, CELL, other), goal=goal).check()


def test_the_good_scene() -> None:
    GOOD.check()


@pytest.mark.parametrize("name", CASES)
def test_refused(name: str) -> None:
    changed, message = CASES[name]
    with pytest.raises(InputError, match=f"^Scene: .*{message}") as caught:
        dataclasses.replace(GOOD, **changed).check()
    assert "\n" not in str(caught.value)


TRACKS: dict[str, tuple[Callable[[], Track], str]] = {
    "unsorted": (
        lambda: Track(times=np.array([0.0, 2.0, 1.0]), values=np.zeros((3, 3))),
        r"times\[2\] = 1 s after 2 s: must be strictly increasing",
    ),
    "twice": (
        lambda: Track(times=np.zeros(2), values=np.zeros((2, 3))),
        r"times\[1\] = 0 s after 0 s: must be strictly",
    ),
    "NaN": (lambda: Track.constant((0.0, NAN, 0.0)), r"values\[0\]\[1\] = nan: must be finite"),
    "endless": (lambda: Track(times=np.array([0.0, np.inf]), values=np.zeros((2, 1))), r"times\[1\] = inf: must be"),
    "too few": (
        lambda: Track(times=np.array([0.0, 1.0]), values=np.zeros((1, 3))),
        "values = 1 samples: must be as many",
    ),
    "flat": (lambda: Track(times=np.array([0.0]), values=np.zeros(1)), r"values = shape \(1,\) of float64: must be"),
    "texts": (
        lambda: Track(times=np.array([0.0]), values=np.array([["a"]])),
        r"values = shape \(1, 1\) of <U1: must be",
    ),
    "none": (lambda: Track(times=np.zeros(0), values=np.zeros((0, 3))), r"times = shape \(0,\) of float64: must be"),
}


@pytest.mark.parametrize("name", TRACKS)
def test_tracks(name: str) -> None:
    make, message = TRACKS[name]
    with pytest.raises(InputError, match=f"^Track: {message}"):
        make()


def test_who_asks(stage_file: StageFile, monkeypatch: pytest.MonkeyPatch) -> None:
    """The reader of files, the builder and the model all ask the one judge."""
    bad = dataclasses.replace(GOOD, **CASES["a bead inside a bead"][0])
    with pytest.raises(InputError, match=r"^Scene: /World/C: overlap with /World/B"):
        Model.build(bad)
    builder = SceneBuilder()
    for item in bad.bodies:
        builder.add(dataclasses.replace(item, rods=()))
    with pytest.raises(InputError, match=r"^SceneBuilder: /World/B: overlap"):
        builder.scene()
    with pytest.raises(InputError, match=r"scene.usda: /World/Robot: overlap"):
        stage_file.load(("(10, 0, 5)", "(4.2, 0, 5)"))


ARGUMENTS: dict[str, tuple[dict[str, Any], str]] = {
    "text as seed": ({"seed": "7"}, "seed is '7'; allowed: a whole number, 0 to 4294967295"),
    "truth as seed": ({"seed": True}, "seed is True; allowed: a whole number, 0 to 4294967295"),
    "fraction as seed": ({"seed": 1.5}, "seed is 1.5; allowed: a whole number"),
    "negative seed": ({"seed": -1}, "seed is -1; allowed: 0 to 4294967295"),
    "worlds": ({"worlds": -3}, "worlds is -3; allowed: 1 or more"),
    "worlds as text": ({"worlds": "2"}, "worlds is '2'; allowed: a whole number, 1 or more"),
    "texts": ({"parameters": {"trap_power": "20"}}, "parameter trap_power is '20' of type <U2; allowed: numbers"),
    "truths": (
        {"parameters": {"trap_power": [True]}},
        r"parameter trap_power is \[True\] of type bool; allowed: numbers",
    ),
    "objects": ({"parameters": {"trap_power": None}}, "parameter trap_power is None of type object; allowed: numbers"),
    "ragged": ({"parameters": {"trap_power": [[1.0], [1.0, 2.0]]}}, "parameter trap_power has rows of unequal length"),
    "complex": ({"parameters": {"trap_power": 1j}}, "parameter trap_power is 1j of type complex128; allowed: numbers"),
    "shape": ({"parameters": {"trap_power": np.ones((5, 7))}}, r"parameter trap_power has shape \(5, 7\); allowed: "),
}


@pytest.mark.parametrize("name", ARGUMENTS)
def test_arguments(name: str) -> None:
    arguments, message = ARGUMENTS[name]
    with pytest.raises(InputError, match=message):
        Model.build(Scene(bodies=(BODY,), traps=(TRAP,)), device="cpu", **arguments)


def test_no_scene() -> None:
    with pytest.raises(InputError, match=r"scene is 'bead.usda'; allowed: a Scene, such as Scene.load reads"):
        Model.build("bead.usda")  # type: ignore[arg-type]
