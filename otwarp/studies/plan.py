"""What a study will take: how many trials and steps, which step each point has, how long that is on a machine."""

from __future__ import annotations

import dataclasses
import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.parameters import PARAMETERS, check_range
from otwarp.studies.any_study import AnyStudy
from otwarp.studies.design import at_values
from otwarp.studies.rows import FARTHEST, base_of, parameter_rows, width_of
from otwarp.studies.targets import Target

SAMPLE = 256
"""Points of a group, evenly chosen, whose time scales say which step all of it can take."""

MOST_MODELS = 4_096
"""Combinations of parameters that are judged one by one where every point has its own step."""

MOST_STEPS = 2**31 - 1
"""Steps of a trial, at most: a device counts those from one look at the worlds to the next in 32 bits."""

PER_POINT = "per point"
"""What `time_step` is where every point takes the step that it needs."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What running a study means, before anything runs.

    Attributes:
        points, groups: Combinations of values, and how many models they need.
        blocks: Tasks, each one chunk of the store.
        trials: Least and largest number of trials.
        time_step: The smallest of any point [s].
        longest_step: The largest of any point [s]; the same but where each has its own.
        steps: World-steps, at most.
        bytes: Of the results, uncompressed, where every trial is computed.
        horizon: How long a trial goes on at most [s].
        budget: Trials of all points together; None: each has its own.
        half_width: That intervals come to with the most trials of a point where that is more than asked for, else None.
        grouped_by: Axes whose values need models of their own.
    """

    points: int
    groups: int
    blocks: int
    trials: tuple[int, int]
    time_step: float
    longest_step: float
    steps: int
    bytes: int
    horizon: float
    budget: int | None = None
    half_width: float | None = None
    grouped_by: tuple[str, ...] = ()


def plan_of(study: AnyStudy) -> Plan:
    """What running it means; nothing is simulated."""
    design, runner, counts = study.design, study.runner, study.step_counts
    per_trial = 5 + 4 * len(runner.numbers)
    share = float(np.mean(counts / counts.max()))
    least, most = study.stop.range_of(design.shape)
    return Plan(
        points=design.points,
        groups=len(design.groups(np.arange(design.points))),
        blocks=len(study.blocks()),
        trials=(least, most),
        time_step=study.horizon / int(counts.max()),
        longest_step=study.horizon / int(counts.min()),
        horizon=study.horizon,
        steps=round(most * share * runner.steps),
        bytes=design.points * 4 + (study.stop.budget or design.points * study.stop.at_most) * per_trial,
        budget=study.stop.budget,
        half_width=study.stop.reached(),
        grouped_by=design.grouped_by,
    )


def steps_of_points(study: AnyStudy, wanted: float | str | None) -> np.ndarray:
    """(points) steps of each point over the horizon: whole numbers, all the same unless each has its own.

    A step of its own is the study's smallest, or twice, four times, … that: as large as the point can take.

    Args:
        study: The study.
        wanted: A step for all [s], `per point`, or None for the largest that all points can take.

    Raises:
        InputError: A scene of some point cannot be stepped, not in the step that is given, there are too many
            combinations to judge one by one, or a trial has too many steps.
    """
    points = study.design.points
    if isinstance(wanted, int | float):
        steps_in(study, wanted)
        counts = np.full(points, max(1, round(study.horizon / wanted)))
        _smallest(study, given=study.horizon / int(counts[0]))
        return counts
    if wanted is None:
        return np.full(points, steps_in(study, _smallest(study)))
    each = _each(study)
    steps_in(study, float(each.min()))
    needed = np.ceil(study.horizon / each).astype(int)
    most = int(needed.max())
    ladder = np.array(sorted({-(-most // 2**j) for j in range(most.bit_length())}))
    return ladder[np.searchsorted(ladder, needed)]


def steps_in(study: AnyStudy, step: float) -> int:
    """Steps of the horizon, none longer than this [s].

    Raises:
        InputError: They are more than a trial may have.
    """
    if not study.horizon / step <= MOST_STEPS:
        name = "until" if any(o.until == study.horizon for o in study.observables) else "horizon"
        raise InputError(f"{name} is {study.horizon:g} s at a time step of {step:.3g} s, "
                         f"{study.horizon / step:.3g} steps a trial; allowed: up to {MOST_STEPS:,} steps, "
                         f"{MOST_STEPS * step:.3g} s")  # fmt: skip
    return math.ceil(study.horizon / step)


def _smallest(study: AnyStudy, given: float | None = None) -> float:
    """The largest step that every point can take [s]; where one is given, which may be as inaccurate as it is, that.

    Raises:
        InputError: A scene cannot be stepped so; the message says which.
    """
    smallest, options = np.inf, study.options
    if given is not None:
        options = dataclasses.replace(options, time_step=given, allow_large_step=True)
    for points, values in study.design.groups(np.arange(study.design.points)):
        scene = study.design.scene_of(values)
        sample = study.design.some(points, SAMPLE)
        origin = Model.build(scene, device="cpu", options=study.options)
        rows = parameter_rows(origin, _worst(study, study.design.at(sample), origin, len(sample)), len(sample))
        try:
            model = Model.build(scene, worlds=len(sample), device="cpu", parameters=rows, options=options)
        except InputError as error:
            raise _where(study, error, values, sample, options) from None
        smallest = min(smallest, model.time_step)
    return float(smallest)


def _where(
    study: AnyStudy, error: InputError, values: dict[Target, Any], points: np.ndarray, options: StepOptions
) -> InputError:
    """The error of a model of points, with the values of the first of them that cannot be stepped by itself."""
    scene = study.design.scene_of(values)
    origin = Model.build(scene, device="cpu", options=study.options)
    own = {t: v for t, v in study.design.at(points).items() if t.kind == "parameter"}
    first = {repr([v[n].tolist() for v in own.values()]): n for n in reversed(range(len(points)))}
    for n in sorted(first.values()):
        rows = parameter_rows(origin, _worst(study, {t: v[n : n + 1] for t, v in own.items()}, origin, 1), 1)
        try:
            Model.build(scene, device="cpu", parameters=rows, options=options)
        except InputError as reason:
            return at_values(reason, values | {t: v[n] for t, v in own.items()})
    return at_values(error, values)


def _each(study: AnyStudy) -> np.ndarray:
    """(points) the largest step that each can take [s]; where a body starts does not count."""
    steps = np.empty(study.design.points)
    models = 0
    for points, values in study.design.groups(np.arange(study.design.points)):
        scene = study.design.scene_of(values)
        origin = Model.build(scene, device="cpu", options=study.options)
        own = {t: v for t, v in study.design.at(points).items() if t.kind == "parameter"}
        own = _worst(study, own, origin, len(points))
        table = np.concatenate([v.reshape(len(points), -1) for v in own.values()] or [np.zeros((len(points), 1))], 1)
        _, first, which = np.unique(table, axis=0, return_index=True, return_inverse=True)
        models += len(first)
        if models > MOST_MODELS:
            raise InputError(
                f"time step is per point, of more than {MOST_MODELS} models; allowed: fewer, or one step for all"
            )
        found = [
            Model.build(
                scene,
                device="cpu",
                parameters=parameter_rows(origin, {t: v[n : n + 1] for t, v in own.items()}, 1),
                options=study.options,
            ).time_step
            for n in first
        ]
        steps[points] = np.array(found)[which.ravel()]
    return steps


def _worst(study: AnyStudy, values: dict[Target, np.ndarray], origin: Model, count: int) -> dict[Target, np.ndarray]:
    """Parameters of so many points, those that scatter as far above where they are as any trial will.

    Raises:
        InputError: Some trial would have a value that is not allowed.
    """
    out = dict(values)
    for target, scatter in study.scatter:
        mean = np.broadcast_to(values.get(target, base_of(origin, target)), count)
        reach = FARTHEST * width_of(mean, target, scatter)
        if target.component is None:
            ends = np.concatenate([mean - reach, mean + reach])
            check_range(
                f"{target.name}, up to {FARTHEST:g} deviations of its scatter off,", PARAMETERS[target.key], ends
            )
        out[target] = mean + reach
    return out


TIMED = {True: 2**16, False: 256}
"""Trials that are timed, on a GPU or a CPU."""

PART, LONGER = 256, 3.0
"""Steps that are timed at first, and how much longer than the start they should take: on a busy machine times differ
from themselves by as much as that."""


def estimate(study: AnyStudy, device: str | None = None) -> tuple[tuple[float, float], str]:
    """Least and largest time [s], and the device: if no trial ended before its horizon.

    Some trials of points all over the study are run over a part of their horizon, with compiled kernels, so far that
    their steps take longer than their start.
    """
    place = pick_device(device)
    runner = study.runner
    count = min(TIMED[place.is_cuda], study.design.points * study.stop.at_most)
    points = np.unique(np.linspace(0, study.design.points - 1, min(count, study.design.points)).astype(int))
    group, values = study.design.groups(points)[0]
    at = {t: v for t, v in study.design.at(group).items() if not t.grouped}
    which = np.resize(np.arange(len(group), dtype=np.int32), count)
    scene = study.design.scene_of(values)

    def taken(steps: int) -> float:
        begun = time.perf_counter()
        runner.shortened(steps).run(scene, at, np.arange(count), which=which, device=str(place))
        return time.perf_counter() - begun

    taken(1)  # kernels are compiled
    start, steps = min(taken(1), taken(1)), min(runner.steps, PART)
    while (long := taken(steps)) < LONGER * start and steps < runner.steps:
        steps = min(runner.steps, 4 * steps)
    per_step = (long - start if long > start else long) / steps / count
    plan = study.plan()
    last = plan.steps * per_step
    return (last * plan.trials[0] / plan.trials[1], last), str(place)
