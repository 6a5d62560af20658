"""Images turned into the frame of a network that has learnt one azimuth, and what it says turned back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from otwarp.vision.datasets.robot import Robot
from otwarp.vision.fourier import Fourier
from otwarp.vision.microscope import Microscope
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.rendering import Rendering, expose
from otwarp.vision.sensor import Sensor
from otwarp.vision.tracking.source import turned, turned_back

ROBOT = Robot.of_solids(*2 * (np.array([[-1.2, 0, 0], [1.0, 0, 0], [0.2, 0.3, 0.4]]),),
                        np.array([0.8, 0.6, 0.3]), np.full(3, 1.5), axis=np.array([1.0, 0.0, 0.0]))  # fmt: skip


def levels(yaw: float, width: int) -> np.ndarray:
    """Grey levels without noise of a robot that leans and lies beside the middle, turned with its place."""
    m = Microscope(numerical_aperture=1.0, condenser_aperture=0.3, pixel=0.11)
    a = math.radians(yaw)
    place = [0.5 * math.cos(a) - 0.2 * math.sin(a), 0.5 * math.sin(a) + 0.2 * math.cos(a), 0.0]
    light = expose(ROBOT.at(20.0, yaw).moved(place), m, width, focus=[1.0], rendering=Rendering(thickness=0.2),
                   fourier=Fourier("cpu"))  # fmt: skip
    return Sensor(noise=0.0, electrons=math.inf, brightness=0.3).levels(light.images([1.0]), seed=0)[0]


@pytest.mark.parametrize("yaw", [90.0, -143.0])
def test_an_image_turned_is_that_of_the_robot_turned(yaw: float) -> None:
    straight, other = levels(0.0, 64).astype(float), levels(yaw, 96)
    contrast = np.std(straight)
    right = turned(other, math.radians(yaw), 64)
    assert np.sqrt(np.mean((right - straight) ** 2)) < 0.05 * contrast
    wrong = turned(other, math.radians(-yaw), 64)
    assert np.sqrt(np.mean((wrong - straight) ** 2)) > 0.3 * contrast


@pytest.mark.quick
def test_what_is_said_is_turned_back() -> None:
    said = np.diag([4.0, 1.0, 2.0, 3.0, np.inf])
    said[0, 2] = said[2, 0] = 0.5
    found = turned_back(Estimate(x=1.0, y=0.5, depth=0.2, tilt=0.1, yaw=0.0, covariance=said), math.radians(90.0))
    assert (found.x, found.y) == pytest.approx((-0.5, 1.0))
    assert (found.depth, found.tilt, found.yaw) == pytest.approx((0.2, 0.1, 0.5 * math.pi))
    assert np.diag(found.covariance)[:4] == pytest.approx([1.0, 4.0, 2.0, 3.0])
    assert found.covariance[1, 2] == pytest.approx(0.5)
    assert np.isinf(found.covariance[4, 4])
    # of a covariance of one direction alone nothing is left that could be turned
    half = turned_back(Estimate(x=1.0, y=0.5, depth=0.2, tilt=0.1, yaw=0.0,
                                covariance=np.diag([4.0, np.inf, 2.0, 3.0, 1.0])), 0.3)  # fmt: skip
    assert half.known == ("depth", "tilt", "yaw")
