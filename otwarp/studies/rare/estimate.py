"""How long a study of escapes takes on a machine, from single runs that are timed."""

from __future__ import annotations

import copy
import time

import numpy as np

from otwarp.device import pick_device
from otwarp.studies.rare.compute import rates_at
from otwarp.studies.rare.study import EscapeStudy

TIMED = 3
"""Points that are timed: the first, one in the middle, the last."""

WORLDS = 2**20
"""Paths that run at once, at most."""


def estimate(study: EscapeStudy, device: str | None = None) -> tuple[float, str]:
    """Time [s] and the device, from two and from four runs of some points; they are not kept.

    How long pilots, runs and their halves take follows from both.
    """
    place = pick_device(device)
    points = np.unique(np.linspace(0, study.design.points - 1, TIMED).astype(int))
    few = copy.copy(study)
    few.halved = False
    few.runs = 2
    rates_at(few, int(points[0]), device=str(place), threads=None, worlds=WORLDS)  # kernels are compiled
    taken = np.empty((2, len(points)))
    for row, runs in enumerate((2, 4)):
        few.runs = runs
        for n, point in enumerate(points):
            begun = time.perf_counter()
            rates_at(few, int(point), device=str(place), threads=None, worlds=WORLDS)
            taken[row, n] = time.perf_counter() - begun
    per_run = np.maximum(taken[1] - taken[0], 0.0) / 2.0
    pilot = np.maximum(taken[0] - 2.0 * per_run, 0.0)
    weight = 3.0 if study.halved else 1.0  # half the step is twice the work
    return float(np.mean(pilot + study.runs * weight * per_run) * study.design.points), str(place)
