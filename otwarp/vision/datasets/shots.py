"""The images of one pose: light passes the robot once, then each image is looked at and recorded."""

from __future__ import annotations

import dataclasses
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from otwarp.vision.datasets.domain import PARAMETERS
from otwarp.vision.datasets.labels import Labels
from otwarp.vision.fourier import Fourier
from otwarp.vision.illumination import Illumination
from otwarp.vision.rendering import Exposed, expose, grid_for, light_for
from otwarp.vision.sampling import reaches

MOST_THREADS = 8
"""That record the images of a pose beside a GPU."""


def exposed_pose(labels: Labels, pose: int, fourier: Fourier, *, rings: int | None = None) -> Exposed:
    """Light that has passed the robot of a pose.

    Args:
        labels: Of the data set.
        pose: Its number.
        fourier: On what.
        rings: Of source points instead of the data set's, to see what they cost.
    """
    spec, microscope = labels.spec, labels.microscope(int(labels.first[pose]))
    how = dataclasses.replace(spec.rendering, azimuth=labels.azimuth(pose))
    if rings is not None:
        # on the grid of all points
        outline = labels.specimen(pose) if labels.outline is None else labels.outline
        grid = grid_for(outline, microscope, spec.width, spec.height, labels.planes, how)
        margin = 0.5 * spec.microscope.pixel * (grid.pixels - max(spec.width, spec.height))
        how = dataclasses.replace(how, rings=rings, margin=max(0.0, margin))
    return expose(
        labels.specimen(pose), microscope, spec.width, spec.height, focus=labels.planes, outline=labels.outline,
        rendering=how, fourier=fourier,
    )  # fmt: skip


def lights_of_pose(labels: Labels, pose: int) -> list[Illumination]:
    """Source points of a pose, for each wavelength."""
    spec, microscope = labels.spec, labels.microscope(int(labels.first[pose]))
    outline = labels.specimen(pose) if labels.outline is None else labels.outline
    grid = grid_for(outline, microscope, spec.width, spec.height, labels.planes, spec.rendering)
    lines = [microscope.at(wavelength) for wavelength, _ in microscope.lines()]
    return [light_for(outline, one, grid, labels.planes, spec.rendering, Fourier()) for one in lines]


def reaches_of(labels: Labels, depths: np.ndarray) -> np.ndarray:
    """(n) how far light goes sideways in images of the first pose at these depths [µm]."""
    outline = labels.specimen(0) if labels.outline is None else labels.outline
    return reaches(labels.microscope(0), outline, -depths)


def pose_intensities(labels: Labels, pose: int, fourier: Fourier, rows: np.ndarray | None = None) -> np.ndarray:
    """(k, height, width) what a perfect sensor would see in images of a pose, 1 where light is unhindered.

    Args:
        labels: Of the data set.
        pose: Its number.
        fourier: On what.
        rows: (k) images of the pose; None: all.
    """
    mine = labels.rows(pose)
    which = np.arange(mine.start, mine.stop) if rows is None else rows
    exposed = exposed_pose(labels, pose, fourier)
    shift = np.stack([labels.arrays["x"][which], labels.arrays["y"][which]], axis=1)
    varies = any(PARAMETERS[name].scope == "image" and name not in ("x", "y") for name in labels.spec.domain)
    objective = [labels.microscope(int(row)) for row in which] if varies else None
    # the robot's centre is at height 0: it is above a focal plane that is below
    return exposed.images(-labels.arrays["depth"][which], objective=objective, shift=shift)


def pose_images(labels: Labels, pose: int, fourier: Fourier, *, threads: int | None = None) -> np.ndarray:
    """(k, height, width) uint8, all images of a pose; what else is rendered changes nothing in them.

    Args:
        labels: Of the data set.
        pose: Its number.
        fourier: On what.
        threads: That record images side by side, to the same bits; None: some where a GPU has rendered them, which
            would wait for one; one on a CPU, where processes share the cores.
    """
    mine = labels.rows(pose)
    light = pose_intensities(labels, pose, fourier)
    count = threads or (min(MOST_THREADS, os.cpu_count() or 1) if fourier.device.is_cuda else 1)

    def recorded(n: int) -> np.ndarray:
        row = mine.start + n
        return labels.sensor(row).levels(light[n], seed=labels.spec.seed, image=row)

    if count == 1:
        return np.stack([recorded(n) for n in range(len(light))])
    with ThreadPoolExecutor(count) as pool:  # NumPy draws and adds without the interpreter's lock
        return np.stack(list(pool.map(recorded, range(len(light)))))
