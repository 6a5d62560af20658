"""Robots in a frame at azimuths that a network has not learnt: shown turned, and which of their ends is which."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from otwarp.vision.datasets.robot import Robot
from otwarp.vision.fourier import Fourier
from otwarp.vision.microscope import Microscope
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.networks.learnt import same_all_around, seen_all_around
from otwarp.vision.rendering import Rendering, expose
from otwarp.vision.sensor import Sensor
from otwarp.vision.tracking.looking import Sighting, sightings
from tests.documents import ROOT

REACH = 8
"""Pixels that a robot may be off the middle."""

TILTS = (0.0, 15.0, 30.0, 45.0, 60.0)
DIFFERS = (np.array([[-1.2, 0.0, 0.0], [1.0, 0.0, 0.0], [0.2, 0.3, 0.4]]), np.array([0.8, 0.6, 0.3]))
ALIKE = (np.array([[-1.1, 0.0, 0.0], [1.1, 0.0, 0.0]]), np.array([0.7, 0.7]))


def robot_of(solids: tuple[np.ndarray, np.ndarray]) -> Robot:
    """Spheres of one index, the long axis along x."""
    places, radius = solids
    return Robot.of_solids(places, places, radius, np.full(len(radius), 1.5), axis=np.array([1.0, 0.0, 0.0]))


def levels(robot: Robot, tilt: float, yaw: float, width: int) -> np.ndarray:
    """Grey levels without noise, the robot in the middle and 1 µm out of focus."""
    m = Microscope(numerical_aperture=1.0, condenser_aperture=0.3, pixel=0.11)
    light = expose(robot.at(tilt, yaw), m, width, focus=[1.0], rendering=Rendering(rings=2, thickness=0.25),
                   fourier=Fourier("cpu"))  # fmt: skip
    return Sensor(noise=0.0, electrons=math.inf, brightness=0.3).levels(light.images([1.0]), seed=0)[0]


class Nearest:
    """Stands for a network of one azimuth: place and tilt of the nearest of its images, surer the nearer that is."""

    pixel, shape = 0.11, (64, 64)

    def __init__(self, robot: Robot, *, around: bool = True, tilts: tuple[float, ...] = TILTS):
        self.about = {"robot": robot.described(), "learnt": {"yaw": (0.0, 0.0), "tilt": (tilts[0], tilts[-1])}}
        self.about |= {"same_all_around": around}
        self.tilts, self.images = tilts, np.array([levels(robot, t, 0.0, 64) for t in tilts], dtype=float)

    def estimate(self, image: np.ndarray) -> list[Estimate]:
        """As `Estimator`."""
        there = np.reshape(image, self.shape).astype(float)
        steps = range(-REACH, REACH + 1)
        inner = slice(REACH, -REACH)
        away = {(n, dx, dy): float(np.mean((np.roll(own, (dy, dx), (0, 1)) - there)[inner, inner] ** 2))
                for n, own in enumerate(self.images) for dx in steps for dy in steps}  # fmt: skip
        n, dx, dy = min(away, key=lambda key: away[key])
        doubt = away[n, dx, dy] + 1e-6
        covariance = np.diag([*(1e-4 * doubt,) * 3, math.radians(1.0) ** 2 * doubt, np.inf])
        return [Estimate(x=dx * self.pixel, y=dy * self.pixel, depth=-1.0, tilt=math.radians(self.tilts[n]), yaw=0.0,
                         covariance=covariance)]  # fmt: skip


def looked(net: Nearest, robot: Robot, tilt: float, yaw: float) -> Sighting:
    """What is said of a robot that is alone in a frame."""
    (one,) = sightings(levels(robot, tilt, yaw, 128), cast(Any, net))
    return one


@pytest.mark.parametrize("yaw", [70.0, -120.0, 35.0])
def test_a_robot_is_seen_at_azimuths_that_were_not_learnt(yaw: float) -> None:
    """Its tilt is right, it lies where it points, and that its ends might be exchanged is said."""
    robot = robot_of(DIFFERS)
    one = looked(Nearest(robot), robot, 30.0, yaw)
    assert one.estimate is not None
    assert math.degrees(one.estimate.tilt) == pytest.approx(30.0)
    assert math.remainder(math.degrees(one.estimate.yaw) - yaw, 360.0) == pytest.approx(0.0, abs=3.0)
    assert abs(one.estimate.yaw) <= math.pi
    assert "which of its ends points along" in one.note
    # without a word of its optics no image is turned
    other = looked(Nearest(robot, around=False), robot, 30.0, yaw)
    assert other.estimate is not None and other.estimate.yaw == 0.0 and "which of its ends" not in other.note


@pytest.mark.parametrize(("tilt", "tilts"), [(30.0, TILTS), (-30.0, TILTS), (15.0, (-30.0, -15.0, 0.0, 15.0, 30.0))])
def test_of_ends_that_are_alike_the_one_that_was_learnt_to_be_up_counts(tilt: float, tilts: tuple[float, ...]) -> None:
    """Tilt and azimuth may both be those of the other end; where both were learnt they are one pose, and no note."""
    robot = robot_of(ALIKE)
    one = looked(Nearest(robot, tilts=tilts), robot, tilt, 70.0)
    assert one.estimate is not None
    axis = [np.array([math.cos(t) * math.cos(y), math.cos(t) * math.sin(y), math.sin(t)])
            for t, y in ((one.estimate.tilt, one.estimate.yaw), (math.radians(tilt), math.radians(70.0)))]  # fmt: skip
    assert abs(float(axis[0] @ axis[1])) > math.cos(math.radians(3.0))
    assert ("which of its ends" in one.note) == (min(tilts) == 0.0)


@pytest.mark.validate
def test_a_network_of_one_azimuth_finds_robots_at_all(tmp_path: Path) -> None:
    """Of 60 robots whose ends differ, alone in their frames; the figures of docs/tracking.md."""
    pytest.importorskip("torch")
    pytest.importorskip("zarr")
    from otwarp.vision.datasets import labels_of, load_spec, make_dataset
    from otwarp.vision.networks import load
    from otwarp.vision.networks.settings import Settings
    from otwarp.vision.networks.train import train

    make_dataset(labels_of(load_spec(ROOT / "vision" / "smoke.toml")), tmp_path / "set", processes=1, device="cpu")
    train(tmp_path / "set", tmp_path / "net", Settings(net="small", epochs=20, batch=8, lr=3e-3, seed=1), device="cpu")
    net = load(tmp_path / "net", device="cpu")
    robot, rng, off = Robot.read(net.about["robot"]), np.random.default_rng(0), []
    m = Microscope(numerical_aperture=1.0, condenser_aperture=0.2, wavelength=0.55, pixel=0.125)
    for seed in range(60):
        tilt, yaw, depth = rng.uniform(0.0, 70.0), rng.uniform(-180.0, 180.0), rng.uniform(-2.5, 2.5)
        light = expose(robot.at(tilt, yaw), m, 128, focus=[0.0], rendering=Rendering(rings=2, thickness=0.25),
                       fourier=Fourier("cpu"))  # fmt: skip
        (one,) = sightings(Sensor(brightness=0.35).levels(light.images([-depth])[0], seed=seed), net)
        assert one.estimate is not None
        away = math.degrees(one.estimate.yaw) - yaw
        off.append([math.degrees(one.estimate.tilt) - tilt, one.estimate.depth - depth, math.remainder(away, 360.0)])
    errors = np.array(off)
    right = np.abs(errors[:, 2]) < 90.0
    assert right.mean() > 0.75
    assert np.all(np.sqrt(np.mean(errors[:, :2] ** 2, axis=0)) < [12.0, 0.8])
    assert np.all(np.sqrt(np.mean(errors[right, :2] ** 2, axis=0)) < [8.0, 0.7])


@pytest.mark.quick
def test_optics_that_are_not_the_same_all_around_are_told() -> None:
    assert same_all_around(Microscope(zernike={4: 0.1, 11: 0.1, 8: 0.0}))
    others: list[dict[str, Any]] = [{"contrast": "dic"}, {"condenser_x": 0.1}, {"condenser_y": -0.1},
                                    {"zernike": {8: 0.1}}, {"zernike": {6: -0.1}}]  # fmt: skip
    assert not any(same_all_around(Microscope(**other)) for other in others)

    def data(zernike: dict[str, float], **labels: np.ndarray) -> Any:
        return SimpleNamespace(manifest={"optics": {"numerical_aperture": 1.0, "zernike": zernike}}, labels=labels)

    assert seen_all_around(data({"11": 0.1}, coma=np.zeros(3), spherical=np.ones(3)))
    assert not seen_all_around(data({"8": 0.1}))
    assert not seen_all_around(data({}, coma=np.array([0.0, 0.1])))
