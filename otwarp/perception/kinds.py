"""Cameras by name: the scene's own, images in files, a video device, GenICam, topics of ROS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from otwarp.errors import InputError
from otwarp.perception.camera import Camera
from otwarp.perception.files import ABOUT, FileCamera
from otwarp.perception.genicam import GenicamCamera
from otwarp.perception.opencv import DeviceCamera
from otwarp.perception.topics import TopicCamera


@dataclass(frozen=True)
class Kind:
    """A kind of camera.

    Attributes:
        make: From what stands after the colon, and options by name.
        options: That it knows, name → type.
        about: For the user.
    """

    make: Callable[..., Camera]
    options: dict[str, Callable[[str], Any]]
    about: str


KINDS: dict[str, Kind] = {
    "files": Kind(
        FileCamera,
        {"rate": float, "loop": int, "shift": float, "bits": int},
        ABOUT,
    ),
    "v4l2": Kind(DeviceCamera, {"rate": float, "exposure": float}, "a video device, through OpenCV"),
    "genicam": Kind(GenicamCamera, {"rate": float, "exposure": float, "cti": str}, "GenICam, through harvesters"),
    "ros1": Kind(TopicCamera.of_ros1, {"master": str, "wait": float}, "sensor_msgs/Image on a topic of ROS 1"),
    "ros2": Kind(TopicCamera.of_ros2, {"domain": int, "wait": float}, "sensor_msgs/Image on a topic of ROS 2"),
}
"""First word of `--camera`, before a colon, → what it is."""


def is_simulated(spec: str) -> bool:
    """Whether a camera is the scene's own: its prim's name, without a colon."""
    return ":" not in spec


def make_camera(spec: str) -> Camera:
    """A camera that is not the scene's, not opened.

    Args:
        spec: `KIND:WHERE[,option=value…]`.

    Raises:
        InputError: No such kind or option.
    """
    kind, _, rest = spec.partition(":")
    if kind not in KINDS:
        raise InputError(
            f"--camera is {spec!r}; allowed: the scene's own by its name, or {', '.join(f'{k}:…' for k in KINDS)}"
        )
    where, *words = rest.split(",")
    if not where:
        raise InputError(f"--camera is {spec!r}; allowed: {kind}:WHERE, {KINDS[kind].about}")
    known, given = KINDS[kind].options, {}
    for word in words:
        name, sign, value = word.partition("=")
        if not sign or name not in known:
            raise InputError(
                f"--camera {spec!r} has {word!r}; allowed: {', '.join(f'{o}=' for o in known) or 'no option'}"
            )
        try:
            given[name] = known[name](value)
        except ValueError:
            raise InputError(f"--camera {spec!r}: {name} is {value!r}; allowed: a number") from None
    return KINDS[kind].make(where, name=spec, **given)
