"""One trial of a study on disk, run again from its seed, with frames of what happened: bit for bit that trial.

A trial is a function of its number alone, whatever runs beside it, so it can be had again without the others. What its
end was is known from the look at which the study saw it; frames are taken more often, of a second simulation without
ends, and held against the first at every look.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.simulation.frame import Frame, capture_frame
from otwarp.simulation.simulation import Simulation
from otwarp.studies.compute import spread
from otwarp.studies.file import load_study
from otwarp.studies.runner import FAULT, GOING
from otwarp.studies.store import Store, check_same
from otwarp.studies.study import Study

FRAMES = 400
"""Frames of a trial, about: at most twice as many."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Rerun:
    """A trial that was run again.

    Attributes:
        scene: Of its point.
        held: (T,) index of the body that each trap holds, −1 for none.
        frames: Of its one world.
        code, time: What its end was, as `Outcomes` has it, and when [s].
        end: The same in words.
        same: Whether it is what the study recorded, and its frames are of the same bits as what was judged.
    """

    scene: Scene
    held: np.ndarray
    frames: tuple[Frame, ...]
    code: int
    time: float
    end: str
    same: bool


def stored_study(store: Store) -> Study:
    """The study that a folder holds, as it was asked.

    Raises:
        InputError: It was described in Python, is one of escapes, or cannot be had again from what its folder keeps.
    """
    asked, file = store.asked(), store.folder / "study.toml"
    if asked.get("kind") == "escape":
        raise InputError(f"{store.folder}: is a study of escapes, whose paths are split; allowed: one of trials")
    if not file.is_file():
        raise InputError(f"{store.folder}: was described in Python, which its folder does not keep; "
                         "allowed: a study that a file describes")  # fmt: skip
    study = load_study(file, scene=store.scene, sources=store.folder / "sources")
    cut = store.cut()
    study = study.in_blocks(cut) if len(cut) == len(study.design.shape) else study
    check_same(store, study.asked())
    return study


def rerun(store: Store, study: Study, point: int, trial: int, *, device: str = "cpu") -> Rerun:
    """Run a trial again.

    Args:
        store: Of the study.
        study: As `stored_study` gave it.
        point: Number of a point, the last dimension fastest.
        trial: Which of the trials of the point, from 0.
        device: Where; bits are those of the study on the same kind of device.

    Raises:
        InputError: There is no such point, or it has no such trial.
    """
    if not 0 <= point < study.design.points:
        raise InputError(f"point = {point}; allowed: 0 … {study.design.points - 1}")
    place = tuple(int(i) for i in np.unravel_index(point, study.design.shape)) if study.design.shape else ()
    with store.reading() as raw:
        done = int(raw["trials"].values[place])
        known = (
            (int(raw["end"].values[place][trial]), float(raw["end_time"].values[place][trial])) if trial < done else ()
        )
    if not 0 <= trial < done:
        raise InputError(f"trial = {trial} of point {point}; allowed: 0 … {done - 1}, those that were run")
    points = np.array([point])
    _, values = study.design.groups(points)[0]
    scene = study.design.scene_of(values)
    runner = study.runner.in_steps(int(study.step_counts[point]))
    number = study.stop.streams(points, study.design.shape) * study.stop.at_most + trial
    asked = {
        "scene": scene,
        "values": {t: v for t, v in study.design.at(points).items() if not t.grouped},
        "trials": number,
        "beside": {t: v for t, v in study.design.at(spread(study, point)).items() if not t.grouped},
        "device": device,
    }
    outcome = runner.run(**asked)
    code, time = int(outcome.code[0]), float(outcome.time[0])
    judged = runner.simulation(**asked)
    shown = dataclasses.replace(runner, ends=()).simulation(**asked)
    last = min(round(time / runner.time_step), runner.steps) if code != GOING else runner.steps
    frames, same = [_captured(shown)], known == (code, float(np.float32(time)))
    stride, done = max(1, last // FRAMES), 0
    while done < last:
        # frames at whole strides, and a comparison wherever the study looked
        look = min((done // runner.every + 1) * runner.every, runner.steps)
        count = min(stride - done % stride, look - done, last - done)
        shown.step(count)
        done += count
        if done == look and done < last:
            judged.step(look - round(judged.state.step))
            same &= np.array_equal(judged.state.position.numpy(), shown.state.position.numpy())
        if done % stride == 0 or done == last:
            frames.append(_captured(shown))
    held = np.array([body for body, _ in shown.model.held], dtype=int)
    return Rerun(
        scene=scene, held=held, frames=tuple(frames), code=code, time=time, end=_words(study, code, time), same=same
    )


def _captured(sim: Simulation) -> Frame:
    """A frame that stays as it is: on a CPU its arrays are those of the simulation."""
    frame = capture_frame(sim)
    arrays = {f.name: getattr(frame, f.name) for f in dataclasses.fields(frame)}
    return dataclasses.replace(frame, **{k: np.array(v) for k, v in arrays.items() if isinstance(v, np.ndarray)})


def _words(study: Study, code: int, time: float) -> str:
    if code == FAULT:
        return f"its state was no longer physical at {time:.4g} s"
    if code == GOING:
        return f"nothing ended it before its horizon, {study.horizon:g} s"
    return f"{study.ends[code - 1].name} at {time:.4g} s"
