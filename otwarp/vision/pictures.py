"""What the camera of a scene records of a moment: the microscope, the bodies within its frame, the sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.fourier import Fourier
from otwarp.vision.frame import Framed, framed
from otwarp.vision.moment import Moments, check_body
from otwarp.vision.rendering import Rendering, expose, warn_if_few
from otwarp.vision.specimen import Specimen
from otwarp.vision.view import camera_of, image_size, microscope_of, sensor_of, specimen_of

MOST_PIXELS = 256
"""Pixels of a side where nobody asks for more."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Images of one moment.

    Attributes:
        focus: (f) heights of the focal planes relative to the camera's own [µm].
        intensity: (f, height, width), 1 where light is unhindered; row 0 is the lowest.
        levels: The same as grey levels of the sensor.
        bits: Of these.
        pixel: [µm].
        solids: Spheres and rods that were in the light.
        sources: Points of the condenser.
        margin: Around the image, where light was computed as well [µm].
        error: (f) what few source points may have cost, as of `Exposed.error`; None where that is not known.
        left_out: Names of bodies of which some solids are at the edge of the margin, and were left out.
        cut: Names of bodies that are in the image and reach beyond it.
    """

    focus: np.ndarray
    intensity: np.ndarray
    levels: np.ndarray
    bits: int
    pixel: float
    solids: int
    sources: int
    margin: float
    error: np.ndarray | None
    left_out: tuple[str, ...]
    cut: tuple[str, ...]


def picture(
    seen: Moments,
    focus: Sequence[float] = (0.0,),
    *,
    size: tuple[int, int] | None = None,
    center: str | None = None,
    rendering: Rendering | None = None,
    seed: int = 0,
    device: str | None = None,
) -> Picture:
    """Images of a moment in focal planes; an exposure is the mean of its moments.

    Args:
        seen: The scene and where its bodies are.
        focus: Heights relative to the camera's focal plane [µm].
        size: Pixels (width, height); None: the camera's frame, at most `MOST_PIXELS`.
        center: Prim of a body that is to be in the middle; None: the camera's middle.
        rendering: How.
        seed: Of the sensor's noise.
        device: Where.

    Raises:
        InputError: No camera, no such body, none in the image or its margin, or the one in the middle does not fit.

    Warns:
        PlausibilityWarning: Rings or a margin that are too few for these planes.
    """
    scene = seen.scene
    camera, microscope, sensor = camera_of(scene), microscope_of(scene), sensor_of(scene)
    frame = image_size(camera)
    width, height = size or (min(frame[0], MOST_PIXELS), min(frame[1], MOST_PIXELS))
    how, where = rendering or Rendering(), Fourier(device)
    planes = camera.focus + np.asarray(focus, dtype=float)
    total, middle, left_out, error = np.zeros((len(planes), height, width)), None, {}, None
    half, cut = 0.5 * microscope.pixel * np.array([width, height]), {}
    owners = np.array([b.name for b in scene.bodies for _ in range(len(b.spheres) + len(b.rods))])
    for position, orientation in zip(seen.position, seen.orientation, strict=True):
        specimen = specimen_of(scene, position, orientation)
        if middle is None:
            middle = _middle(seen, center)
        whole = specimen.moved(-middle)
        there = framed(whole, microscope, width, height, planes, how)
        names = list(dict.fromkeys(owners[there.left_out]))
        _check_inside(there, whole, owners, center, names)
        left_out.update(dict.fromkeys(names))
        cut.update(dict.fromkeys(_cut(whole, owners, half)))
        exposed = expose(
            there.specimen, microscope, width, height, focus=planes, rendering=there.rendering, fourier=where
        )
        total += exposed.images(planes) / len(seen.position)
        if error is None:
            warn_if_few(there.specimen, microscope, width, height, planes, how)
            error = exposed.error(planes)
    levels = sensor.levels(total, seed=seed)
    return Picture(
        np.asarray(focus, dtype=float), total, levels, sensor.bits, microscope.pixel, solids=len(there.specimen),
        sources=exposed.sources, margin=exposed.margin, error=error, left_out=tuple(left_out),
        cut=tuple(cut),
    )  # fmt: skip


def _check_inside(there: Framed, whole: Specimen, owners: np.ndarray, center: str | None, names: list[str]) -> None:
    """Refuse an image that leaves out the body in its middle, or all bodies."""
    if center in names:
        raise InputError(f"--center is {center}, which reaches beyond the image and its margin of "
                         f"{there.margin:.3g} µm; allowed: a larger --size or margin")  # fmt: skip
    if not there.inside and len(whole):
        _refuse_empty(whole, owners)


def _cut(solids: Specimen, owners: np.ndarray, half: np.ndarray) -> list[str]:
    """Names of bodies that are in an image of half the sides `half` (2) [µm] and reach beyond it."""
    low, high = (corner[:, :2] for corner in solids.boxes())
    within, beyond = np.all((high > -half) & (low < half), axis=1), np.any((low < -half) | (high > half), axis=1)
    return [name for name in dict.fromkeys(owners[within]) if np.any(beyond[owners == name])]


def _refuse_empty(solids: Specimen, owners: np.ndarray) -> None:
    """Say where the nearest body is.

    Raises:
        InputError: Always.
    """
    away = np.hypot(*(0.5 * (solids.start + solids.end))[:, :2].T)
    n = int(np.argmin(away))
    raise InputError(f"no body is in the image, {owners[n]} is nearest, {away[n]:.3g} µm from its middle; allowed: a "
                     f"larger --size, or --center {owners[n]}")  # fmt: skip


def _middle(seen: Moments, center: str | None) -> np.ndarray:
    """(3) the middle of the image in the frame of the camera [µm], at height 0."""
    if center is None:
        return np.zeros(3)
    check_body(seen.scene, center)
    index = [b.name for b in seen.scene.bodies].index(center)
    alone = specimen_of(seen.scene, seen.position[0], seen.orientation[0])
    first = sum(len(b.spheres) + len(b.rods) for b in seen.scene.bodies[:index])
    own = slice(first, first + len(seen.scene.bodies[index].spheres) + len(seen.scene.bodies[index].rods))
    middle = 0.25 * (alone.start[own].min(axis=0) + alone.start[own].max(axis=0)
                     + alone.end[own].min(axis=0) + alone.end[own].max(axis=0))  # fmt: skip
    return np.array([middle[0], middle[1], 0.0])
