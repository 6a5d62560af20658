"""Which solids of a scene an image is computed of: those in it, and those beside it whose light reaches in."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from otwarp.vision.microscope import Microscope
from otwarp.vision.rendering import Rendering
from otwarp.vision.sampling import margin_needed, reaches
from otwarp.vision.specimen import Specimen


@dataclass(frozen=True, eq=False)
class Framed:
    """What is in the light.

    Attributes:
        specimen: Solids wholly within the image and its margin.
        rendering: As asked for, with that margin as a number.
        margin: That number [µm].
        inside: How many of these reach into the image.
        left_out: Numbers, in the whole specimen, of solids at the edge of the margin or beyond it whose light reaches
            into the image.
    """

    specimen: Specimen
    rendering: Rendering
    margin: float
    inside: int
    left_out: np.ndarray


def framed(
    specimen: Specimen, microscope: Microscope, width: int, height: int, focus: np.ndarray, rendering: Rendering
) -> Framed:
    """Pick the solids, and the margin where it is `auto`.

    A margin that is chosen holds every solid in the image, and the distance that its light goes; of solids beside the
    image it holds those that happen to be within.

    Args:
        specimen: All solids, relative to the middle of the image.
        microscope: Its pixel.
        width, height: Of the image [pixels].
        focus: (f) heights of the planes [µm].
        rendering: How.
    """
    half = 0.5 * microscope.pixel * np.array([width, height])
    low, high = specimen.boxes()
    # how far each is beside the image; below 0 for those in it
    beside = np.maximum(low[:, :2] - half, -half - high[:, :2]).max(axis=1, initial=-np.inf)
    inside = beside < 0.0
    near = inside.copy()
    for n in np.flatnonzero(~inside):
        near[n] = beside[n] < float(reaches(microscope, specimen.some(np.array([n])), focus).max(initial=0.0))
    margin = rendering.margin
    if margin == "auto":
        within = specimen.some(np.flatnonzero(inside))
        margin = margin_needed(microscope, within, width, height, focus, lattice=rendering.rings == "auto")
        if not inside.any() and near.any():
            beyond = specimen.some(np.flatnonzero(near))
            margin = max(margin, float(reaches(microscope, beyond, focus).max(initial=0.0)))
    how = dataclasses.replace(rendering, margin=margin)
    edge = 0.5 * microscope.pixel * max(width, height) + margin
    held = np.maximum(np.abs(low[:, :2]), np.abs(high[:, :2])).max(axis=1, initial=0.0) <= edge
    kept = held & near
    return Framed(
        specimen.some(np.flatnonzero(kept)), how, margin, int(np.sum(kept & inside)), np.flatnonzero(near & ~held)
    )
