"""`otwarp teleop --camera`: what is refused before anything runs, and what a laboratory may differ by."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError, PlausibilityWarning
from otwarp.perception.assemble import followed_bodies
from otwarp.perception.calibrated import calibrated
from otwarp.perception.kinds import make_camera
from otwarp.perception.plant import Plant, PlantOptions, plant_of, plant_scene
from otwarp.perception.sources import network_of, piece_size
from otwarp.scene import Scene
from otwarp.vision.calibration.file import Calibration
from otwarp.vision.calibration.measured import Measured
from otwarp.vision.datasets.robot import Robot
from otwarp.vision.view import image_size

SMALL = "scenes/teleop_small.usda"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--perception", "templates"], "--perception is given without a camera; allowed with --camera"),
        (["--plant", SMALL], "--plant is given without a camera"),
        (["--camera-device", "cpu"], "--camera-device is given without a camera"),
        (["--camera", "top", "--camera-device", "gpu"], "--camera-device is 'gpu'; allowed: cpu"),
        (["--camera", "side"], "--camera is side; allowed: top, or KIND:…"),
        (["--camera", "usb:0"], "--camera is 'usb:0'; allowed: the scene's own by its name, or files:…"),
        (["--camera", "top", "--speed", "0.5"], "--speed is 0.5; allowed with --camera: 1"),
        (["--camera", "top", "--budget", "0.5"], "--budget is 0.5; allowed with --camera: off"),
        (["--camera", "top", "--follow", "nobody"], "body is nobody; allowed: /World/Robots/left"),
        (["--camera", "top", "--plant", "scenes/single_bead.usda"], "has 1 traps; allowed: as many as the twin, 6"),
        (["--camera", "top", "--plant-viscosity", "200"], "plant viscosity is 200; allowed: 0.01 to 100"),
        (["--camera", "files:images"], "--calibration is missing for --camera files:images; allowed: what otwarp"),
        (["--camera", "top", "--calibration", "absent.json"], "absent.json: cannot be read"),
    ],
)
def test_what_is_refused(words, said, capfd):
    assert main(["teleop", SMALL, "--no-page", "--duration", "0.1", *words]) == 2
    error = capfd.readouterr().err
    assert said in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("spec", "stand_in"),
    [
        ("v4l2:0", "a double of OpenCV"),
        ("genicam:0,cti=vendor.cti", "a double of harvesters"),
        ("ros1:/camera/image_raw", "otwarp's own publishers"),
        ("ros2:/camera/image_raw", "otwarp's own publishers"),
    ],
)
def test_a_camera_that_no_binding_has_met_says_so(spec, stand_in):
    info = make_camera(spec).info
    assert not info.met_hardware
    assert info.caution == f"camera {spec}: this way was tested with {stand_in}; no camera has met it"


@pytest.mark.thorough
def test_a_session_with_such_a_camera_says_it_first(capfd):
    """Here it ends before the camera is opened, because there is no such network."""
    words = ["--camera", "v4l2:0", "--calibration", "scene", "--perception", "absent"]
    assert main(["teleop", SMALL, "--no-page", "--duration", "0.1", *words]) == 2
    out, error = capfd.readouterr()
    assert out == "camera v4l2:0: this way was tested with a double of OpenCV; no camera has met it\n"
    assert "absent" in error
    words[1] = "files:images"
    assert main(["teleop", SMALL, "--no-page", "--duration", "0.1", *words]) == 2
    assert "no camera has met it" not in capfd.readouterr().out


def measured(value: float) -> Measured:
    return Measured.of(value, 1e-4 * value, 10.0, "µm", "a test")


def test_a_calibration_is_of_this_camera(tmp_path: Path):
    scene = dataclasses.replace(Scene.load("scenes/strategy_a.usda"), camera=Scene.load(SMALL).camera)
    camera = scene.camera
    assert camera is not None
    optics = {"wavelength": camera.wavelength, "numerical_aperture": camera.numerical_aperture}
    right = Calibration({"pixel": measured(0.1605), "trap_plane": measured(0.3)}, {"optics": optics})
    file = str(right.save(tmp_path / "right.json"))
    own = calibrated(scene, file, simulated=True, camera="top").camera
    real = calibrated(scene, file, simulated=False, camera="v4l2:0").camera
    assert own is not None and real is not None
    assert own.pixel_size == real.pixel_size == pytest.approx(0.1605)
    # places count from the middle of as many pixels as the camera has
    assert image_size(own) == image_size(real) == image_size(camera)
    # the focal plane lies where the traps are, less what these are above it
    assert (own.focus, real.focus) == (camera.focus, pytest.approx(15.0 - 0.3))
    assert calibrated(scene, "scene", simulated=False, camera="v4l2:0") is scene
    deep = dataclasses.replace(scene, camera=dataclasses.replace(camera, bits=12))
    for simulated, bits in ((True, 12), (False, 8)):  # of a real camera eight bits are looked at
        found = calibrated(deep, "scene", simulated=simulated, camera="v4l2:0").camera
        assert found is not None and found.bits == bits
    others = {
        "its pixel is 0.17 µm": Calibration({"pixel": measured(0.17)}, {"optics": optics}),
        "its numerical_aperture is 1.2": Calibration(
            {"pixel": measured(0.16)}, {"optics": optics | {"numerical_aperture": 1.2}}
        ),
        "says no pixel": Calibration({"depth_scale": measured(1.0)}),
    }
    for said, other in others.items():
        with pytest.raises(InputError, match=said):
            calibrated(scene, str(other.save(tmp_path / "other.json")), simulated=True, camera="top")
    Calibration({"pixel": measured(math.nan)}, {"optics": optics}).save(tmp_path / "other.json")
    with pytest.raises(InputError, match=r"results cannot be read .*value is nan"):
        calibrated(scene, str(tmp_path / "other.json"), simulated=True, camera="top")
    (tmp_path / "other.json").write_text(json.dumps({"format": "x"}), encoding="utf-8")
    with pytest.raises(InputError, match="is no calibration"):
        calibrated(scene, str(tmp_path / "other.json"), simulated=True, camera="top")


def network(scene: Scene, index: int, **changes: Any) -> Any:
    """What `load` gives, as far as it is asked before it looks at anything."""
    pixel = scene.camera.pixel_size if scene.camera is not None else 0.0
    robot = Robot.of_body(scene, scene.bodies[index].name).described()
    given = {
        "pixel": pixel,
        "shape": (96, 96),
        "about": {"heads": "pose", "robot": robot},
        "names": ("x", "y", "depth"),
    }
    given |= changes
    return SimpleNamespace(**given, targets=SimpleNamespace(names=given["names"]))


def test_a_network_is_of_this_robot_and_camera():
    scene = Scene.load(SMALL)
    right = network(scene, 0)
    assert network_of(scene, 0, right, "net").net is right
    # of another robot with as many solids of the same radii, one of which is elsewhere
    moved = json.loads(json.dumps(right.about["robot"]))
    moved["spheres"][0]["center"][0] += 0.1
    wrong = {
        r"takes pixels of 0.065 µm; allowed: the camera's, 0.16 µm": {"pixel": 0.065},
        r"takes levels of 6 bits; allowed: the camera's, 8": {"about": right.about | {"bits": 6}},
        r"takes images of 96 × 80 pixels; allowed: squares": {"shape": (80, 96)},
        r"says no depth; allowed: heads pose or both": {"names": ("x", "y", "tilt")},
        r"says classes and normalised depth alone": {"about": {"heads": "paper"}},
        r"the robot \(/World/Robots/left, 13 solids, .*\) is not that of the network \(/World/cell, 1 solids, 6 µm\)": {
            "about": {"heads": "pose", "robot": Robot.of_body(scene, "/World/cell").described()}
        },
        r"is not that of the network \(/World/Robots/left, 13 solids": {"about": {"heads": "pose", "robot": moved}},
    }
    for said, changes in wrong.items():
        with pytest.raises(InputError, match=said):
            network_of(scene, 0, network(scene, 0, **changes), "net")
    other = network(scene, 0, about={"heads": "pose", "robot": moved})
    assert network_of(scene, 0, other, "net", any_robot=True).net is other


def test_what_a_network_has_not_learnt_is_said_and_azimuths_are_turned():
    """The robot begins at an azimuth of 90°, in a light of NA 0.3: of either a network may know nothing."""
    scene = Scene.load(SMALL)
    about = network(scene, 0).about
    known = {"yaw": [60.0, 120.0], "condenser_aperture": [0.3, 0.3]}
    assert network_of(scene, 0, network(scene, 0, about=about | {"learnt": known}), "net").azimuth is None
    lies = {"yaw": [-15.0, 15.0], "condenser_aperture": [0.2, 0.2]}
    with pytest.warns(PlausibilityWarning, match=r"not learnt condenser aperture 0.3 \(learnt: 0.2\)"):
        turned = network_of(scene, 0, network(scene, 0, about=about | {"learnt": lies}), "net")
    assert (turned.azimuth, abs(turned.start)) == pytest.approx((0.0, math.pi / 2))
    assert turned.side == 138  # √2 of 96 pixels, and a little
    # through coma a robot that is turned has another image than the one that is turned
    assert scene.camera is not None
    askew = dataclasses.replace(scene, camera=dataclasses.replace(scene.camera, coma=0.1))
    with pytest.warns(PlausibilityWarning, match=r"not learnt yaw .* \(learnt: -15 to 15°\), condenser"):
        assert network_of(askew, 0, network(askew, 0, about=about | {"learnt": lies}), "net").azimuth is None


def test_a_laboratory_has_its_own_viscosity_and_sizes():
    scene = Scene.load(SMALL)
    plant = plant_scene(scene, PlantOptions(seed=3, viscosity=2.0, spread=0.1))
    assert plant.medium.viscosity == pytest.approx(2.0 * scene.medium.viscosity)
    ratios = [p.spheres[0].radius / b.spheres[0].radius for p, b in zip(plant.bodies, scene.bodies, strict=True)]
    assert len(set(np.round(ratios, 6))) == 3 and np.allclose(ratios, 1.0, atol=0.5)
    offsets = [
        p.spheres[2].offset[0] / b.spheres[2].offset[0] for p, b in zip(plant.bodies[:2], scene.bodies[:2], strict=True)
    ]
    assert offsets == pytest.approx(ratios[:2])
    assert plant_scene(scene, PlantOptions(seed=3, spread=0.1)).bodies == plant.bodies
    other = plant_of(scene, "scenes/cell_delivery.usda")
    assert other.camera == scene.camera and len(other.obstacles) > len(scene.obstacles)


def test_a_body_that_is_named_twice_is_followed_once():
    assert followed_bodies(Scene.load(SMALL), ["/World/cell", "/World/Robots/left", "/World/cell"]) == [2, 0]


@pytest.mark.thorough
def test_a_laboratory_of_other_sizes_runs():
    """Robots that hold a cell grow into it by more than contact takes, were they not put out of it."""
    scene = Scene.load("scenes/cell_delivery.usda")
    there = plant_scene(scene, PlantOptions(spread=0.05))
    assert [b.position == a.position for a, b in zip(there.bodies, scene.bodies, strict=True)] == [False, True, True]
    plant = Plant(there, device="cpu")
    plant.begin(0.0)
    plant.follow(0.05, plant.place, np.array([trap.power.at(0.0)[0] for trap in scene.traps]))
    position, _ = plant.poses()
    moved = position - np.array([body.position for body in scene.bodies])
    assert plant.time >= 0.05 and np.linalg.norm(moved, axis=1).max() < 1.0


def test_pieces_hold_a_body_however_it_turns():
    scene = Scene.load(SMALL)
    sizes = [piece_size(scene, n) for n in range(3)]
    assert sizes == [96, 96, 56]  # 12.6 µm and 6 µm, and a micrometre of fringes on each side, in pixels of 0.16 µm
    assert scene.camera is not None
    fine = dataclasses.replace(scene, camera=dataclasses.replace(scene.camera, pixel_size=0.08))
    assert piece_size(fine, 2) == 104
