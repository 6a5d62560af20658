"""The images of one pose: light passes the robot once, then each image is looked at and recorded."""

from __future__ import annotations

import dataclasses
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from otwarp.vision.datasets.domain import PARAMETERS
from otwarp.vision.datasets.labels import Labels
from otwarp.vision.fourier import Fourier
from otwarp.vision.render import Exposed, expose

MOST_THREADS = 8
"""That record the images of a pose beside a GPU."""


def exposed_pose(labels: Labels, pose: int, fourier: Fourier, *, rings: int | None = None) -> Exposed:
    """Light that has passed the robot of a pose.

    Args:
        labels: Of the data set.
        pose: Its number.
        fourier: On what.
        rings: Of source points; None: those of the data set.
    """
    spec = labels.spec
    how = dataclasses.replace(spec.rendering, azimuth=labels.azimuth(pose), rings=rings or spec.rendering.rings)
    microscope = labels.microscope(int(labels.first[pose]))
    return expose(labels.specimen(pose), microscope, spec.width, spec.height, rendering=how, fourier=fourier)


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
