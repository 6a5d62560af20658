"""Which way something in a frame points, and networks that are shown it turned to where they have learnt to see it."""

from __future__ import annotations

import math

import numpy as np

from otwarp.vision.datasets.robot import Robot
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.networks.learnt import exceeded
from otwarp.vision.networks.run import Estimator
from otwarp.vision.networks.targets import turned_round
from otwarp.vision.tracking.finding import Found
from otwarp.vision.tracking.source import NetworkSource, learnt_azimuths, turns

ROUND = 1.15
"""Length over width of contrast up to which it points nowhere: 1.06 of a cell beside robots, 1.5 and more of these."""

OFF = math.radians(5.0)
"""Beyond the learnt azimuths, from which on contrast that points there is shown turned; it points right to 1°."""

ALIKE = 2.0
"""Standard deviations within which two estimates are of one pose."""


def source_of(net: Estimator) -> NetworkSource:
    """A network for frames of no known scene; with an azimuth where images can be turned for it.

    They cannot where its file does not say, as files of before do not, that its optics are the same all around.

    Args:
        net: Of `otwarp.vision.networks.load`.
    """
    if "robot" not in net.about or not net.about.get("same_all_around", False) or net.shape[0] != net.shape[1]:
        return NetworkSource(net)
    long = not Robot.read(net.about["robot"]).symmetry()["spherical"]
    return NetworkSource(net, learnt_azimuths(net)[0]) if turns(net, long=long, same=True) else NetworkSource(net)


def guesses(f: Found, source: NetworkSource) -> list[np.ndarray] | None:
    """Both azimuths that long contrast may have, as poses (5) of which they alone count [rad]; None: nothing is turned.

    Args:
        f: What was found.
        source: That is to look at it.
    """
    if source.azimuth is None or f.length < ROUND * f.width or beyond(f, source.net) < OFF:
        return None
    ways = (math.remainder(f.azimuth + half, 2.0 * math.pi) for half in (0.0, math.pi))
    return [np.array([0.0, 0.0, 0.0, 0.0, way]) for way in ways]


def beyond(f: Found, net: Estimator) -> float:
    """By how much contrast points beyond the learnt azimuths, modulo half a turn [rad]; 0 or less where they hold it.

    Args:
        f: What was found.
        net: Of `otwarp.vision.networks.load`.
    """
    middle, half = learnt_azimuths(net)
    return abs(math.remainder(f.azimuth - middle, math.pi)) - half


def better(net: Estimator, one: Estimate, other: Estimate) -> tuple[Estimate, str]:
    """Of what a network says of an image that is turned either way round the likelier, and what is said of the other.

    That is the one with less beyond what was learnt, and then the one that is stated to be surer.

    Args:
        net: The network.
        one, other: With azimuths half a turn apart.

    Returns:
        One of the two, and a note where the other is another pose.
    """
    first, second = sorted((one, other), key=lambda e: (_strange(net, e), _doubt(e)))
    robot = Robot.read(net.about["robot"])
    if turned_round(robot.symmetry(), False):
        spread = ALIKE * np.sqrt(np.diag(first.covariance) + np.diag(second.covariance))
        if abs(first.tilt + second.tilt) <= spread[3] and abs(first.depth - second.depth) <= spread[2]:
            return first, ""
    way = f"which of its ends points along {math.degrees(first.yaw):.0f}° is not sure: the other way round depth "
    return first, f"{way}{second.depth:.3g} µm, tilt {math.degrees(second.tilt):.3g}°"


def estimated(estimate: Estimate, turned_by: float = 0.0) -> dict[str, tuple[float, float]]:
    """What a network has estimated, as `exceeded` takes it.

    Args:
        estimate: Of a network.
        turned_by: By which its image was turned [rad]; of the azimuth counts what the network saw.
    """
    found = {"depth": estimate.depth, "tilt": math.degrees(estimate.tilt)}
    found["yaw"] = math.degrees(math.remainder(estimate.yaw - turned_by, 2.0 * math.pi))
    return {name: (value, value) for name, value in found.items() if name in estimate.known}


def _strange(net: Estimator, estimate: Estimate) -> int:
    """How many of depth and tilt are beyond what was learnt."""
    return len(exceeded(net.about, {k: v for k, v in estimated(estimate).items() if k != "yaw"}))


def _doubt(estimate: Estimate) -> float:
    """Logarithm of the volume of an estimate's covariance."""
    known = np.isfinite(np.diag(estimate.covariance))
    return float(np.linalg.slogdet(estimate.covariance[np.ix_(known, known)])[1])
