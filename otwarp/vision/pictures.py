"""What the camera of a scene records of a moment: the microscope, the bodies within its frame, the sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.fourier import Fourier
from otwarp.vision.moment import Moments, check_body
from otwarp.vision.render import Rendering, expose
from otwarp.vision.specimen import Specimen
from otwarp.vision.view import camera_of, image_size, microscope_of, sensor_of, specimen_of, within

MOST_PIXELS = 256
"""Pixels of a side where nobody asks for more."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Images of one moment.

    Attributes:
        focus: (f) heights of the focal planes relative to the camera's own [µm].
        intensity: (f, height, width), 1 where light is unhindered; row 0 is the lowest.
        levels: The same as grey levels of the sensor.
        pixel: [µm].
        solids: Spheres and rods that were in the light.
        sources: Points of the condenser.
    """

    focus: np.ndarray
    intensity: np.ndarray
    levels: np.ndarray
    pixel: float
    solids: int
    sources: int


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
        InputError: No camera, no such body, or solids that do not fit.
    """
    scene = seen.scene
    camera, microscope, sensor = camera_of(scene), microscope_of(scene), sensor_of(scene)
    frame = image_size(camera)
    width, height = size or (min(frame[0], MOST_PIXELS), min(frame[1], MOST_PIXELS))
    how, where = rendering or Rendering(), Fourier(device)
    planes = camera.focus + np.asarray(focus, dtype=float)
    total, solids, sources = np.zeros((len(planes), height, width)), 0, 0
    middle = None
    for position, orientation in zip(seen.position, seen.orientation, strict=True):
        specimen = specimen_of(scene, position, orientation)
        if middle is None:
            middle = _middle(seen, center)
        specimen = _inside(specimen.moved(-middle), width, height, microscope.pixel, how.margin)
        exposed = expose(specimen, microscope, width, height, rendering=how, fourier=where)
        total += exposed.images(planes) / len(seen.position)
        solids, sources = len(specimen), sum(len(light.weights) for _, light, _, _ in exposed.parts)
    levels = sensor.levels(total, seed=seed)
    return Picture(np.asarray(focus, dtype=float), total, levels, microscope.pixel, solids, sources)


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


def _inside(specimen: Specimen, width: int, height: int, pixel: float, margin: float) -> Specimen:
    """The solids that reach into the image and lie within what is computed around it.

    Raises:
        InputError: One is cut by the edge of what is computed.
    """
    half = 0.5 * pixel * np.array([width, height])
    seen = within(specimen, *half)
    edge = 0.5 * pixel * max(width, height) + margin
    if len(seen) and max(np.abs(seen.low[:2]).max(), np.abs(seen.high[:2]).max()) > edge:
        beyond = max(np.abs(seen.low[:2]).max(), np.abs(seen.high[:2]).max())
        raise InputError(f"bodies in the image reach {beyond:.3g} µm from its middle; allowed: up to {edge:.3g} µm, "
                         "a larger --size or --center on a body")  # fmt: skip
    return seen
