"""How long a study takes on a machine, from a block of trials that is timed."""

from __future__ import annotations

import time

import numpy as np

from otwarp.device import pick_device
from otwarp.studies.study import Study

TRIALS = {True: 2**16, False: 256}
"""Trials that are timed, on a GPU or a CPU."""


def estimate(study: Study, device: str | None = None) -> tuple[tuple[float, float], str]:
    """Least and largest time [s], and the device: if no trial ended before its horizon.

    Some trials of points all over the study are run twice, the second time with compiled kernels, over a part of their
    horizon.
    """
    place = pick_device(device)
    runner = study.runner
    count = min(TRIALS[place.is_cuda], study.design.points * study.stop.at_most)
    points = np.unique(np.linspace(0, study.design.points - 1, min(count, study.design.points)).astype(int))
    group, values = study.design.groups(points)[0]
    chosen = np.resize(group, count)
    at = {t: v for t, v in study.design.at(chosen).items() if not t.grouped}
    scene = study.design.scene_of(values)
    most = min(runner.steps, 256)
    taken: list[float] = []
    for steps in (1, 1, most):
        begun = time.perf_counter()
        runner.shortened(steps).run(scene, at, np.arange(count), device=str(place))
        taken.append(time.perf_counter() - begun)
    per_step = max(taken[2] - taken[1], 1e-9) / max(most - 1, 1) / count
    plan = study.plan()
    first, last = (trials * runner.steps * per_step for trials in plan.trials)
    return (first, last), str(place)
