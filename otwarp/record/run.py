"""`record_run`: simulate a scene frame by frame and record it: the Python call behind `otwarp run`."""

from __future__ import annotations

import math
import time as clock
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.files import check_place
from otwarp.record.method import Method
from otwarp.record.recorder import FILES, Recorder, check_folder
from otwarp.scene import Scene
from otwarp.simulation.frame import capture_frame
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.capacity import check_worlds
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.time_step.observables import spelled

COPIES = 3
"""Frames held on the host at the same time: the one that is read, the last one, and sums for the statistics."""

MOST_STEPS = 1e12
"""A run of more steps is refused: at a microsecond each it takes twelve days."""


def record_run(
    scene: Scene,
    folder: str | Path,
    *,
    worlds: int = 1,
    seed: int = 0,
    device: str | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    threads: int | None = None,
    frames_per_second: float | None = None,
    recorded_worlds: int | None = None,
    force_arrows: bool = False,
    checkpoint: str | Path | None = None,
    resume: str | Path | None = None,
    options: StepOptions | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> dict:
    """Simulate `scene` for its duration and record every frame in `folder`, and the end if it falls between frames.

    Args:
        folder: Gets `run.usda` and its trajectory, `run.nc`, `summary.json` and `figure.png`.
        worlds, seed, device, parameters, threads: As for `Simulation`.
        frames_per_second: Recorded frames per simulated second; None takes the scene's.
        recorded_worlds: Worlds kept in `run.nc`; None keeps all. USD and figure show world 0.
        force_arrows: Write force arrows into the USD recording.
        checkpoint: File to which the end of the run is saved.
        resume: Checkpoint from which to start; all that says how to step is then its own.
        options: What is chosen about the step; with `resume` of these only the forces' functions count. `run.nc` is in
            their precision, and `run.usda` in float64 but for point instances.
        progress: Called with simulated time and wall time [s] after every frame, the first one included.

    Returns:
        The summary that was written to `summary.json`.

    Raises:
        InputError: An argument that cannot be accepted; nothing is written.
        SimulationError: The run stopped; everything up to the last good frame is on disk.
        OSError: The disk is full, or the folder has gone.
    """
    rate = frames_per_second if frames_per_second is not None else scene.settings.frames_per_second
    _check_rate(rate)
    check_folder(Path(folder), scene.file)
    if checkpoint is not None:
        _check_checkpoint(Path(checkpoint), Path(folder))
    if resume is None and recorded_worlds is not None and not 1 <= recorded_worlds <= worlds:
        raise InputError(f"recorded worlds = {recorded_worlds}; allowed: 1 to {worlds}, the worlds of the run")
    about: dict = {"worlds": worlds, "seed": seed, "parameters": parameters}
    sim = _started(scene, resume, device, threads, about, options or StepOptions())
    _check_step(sim, rate)
    how: dict = {"frames_per_second": rate, "worlds": recorded_worlds, "forces": force_arrows, "seed": sim.model.seed}
    how |= {"time_step": sim.time_step, "held": sim.model.held, "method": Method.of(sim.model)}
    scales = sim.model.scales
    with Recorder(sim.scene, Path(folder), **how, errors=scales.errors) as recorder:
        if scales.missed:
            recorder.warn(_missed_text(scales.missed, scales.accuracy))
        _frames(sim, recorder, rate, progress)
    if checkpoint is not None:
        sim.save(checkpoint)
    return recorder.summary


def _missed_text(missed: Mapping[str, float], accuracy: float) -> str:
    """What a run says of errors above the wanted accuracy; of gaps alone, whose size stands among the others, whether
    to care."""
    wanted = f"the wanted accuracy of {100.0 * accuracy:g} %"
    if set(missed) == {"contact"}:
        return (
            f"gaps between bodies and what they are pressed on miss {wanted}, which no affordable time step mends; it "
            "matters where gaps are measured, all else is within it (docs/dynamics.md)"
        )
    return f"the time step misses {wanted} in {spelled(missed)}"


def _started(
    scene: Scene,
    resume: str | Path | None,
    device: str | None,
    threads: int | None,
    about: dict,
    options: StepOptions,
) -> Simulation:
    """The simulation at its start, made with `about` and `options`, or as a checkpoint holds it."""
    if resume is not None:
        return Simulation.restore(resume, scene, device=device, threads=threads, forces=options.forces)
    check_worlds(scene, about["worlds"], pick_device(device), options.precision, COPIES)
    return Simulation(scene, device=device, threads=threads, readout=True, **about, **vars(options))


def _check_step(sim: Simulation, rate: float) -> None:
    """Refuse frames and lengths that do not suit the step, and a run that is over before it starts."""
    check_length(sim.scene.settings.duration, sim.time_step, rate)
    if sim.state.step >= round(sim.scene.settings.duration / sim.time_step):
        raise InputError(
            f"the run of the checkpoint is complete: it stands at {sim.time:.6g} s and the duration is "
            f"{sim.scene.settings.duration:g} s; allowed: a longer duration"
        )


def check_run(scene: Scene) -> list[str]:
    """Refuse what `record_run` would refuse of a scene run as it was authored; nothing is compiled or written.

    The model is built as for a run, on the CPU, so that no refusal can be missed; tables of optical forces that are not
    in the cache are made for that.

    Returns:
        What building the model warns of, one line each, but for what is implausible: `otwarp.scene.validate` says that.

    Raises:
        InputError: In one line, as `record_run` would.
    """
    _check_rate(scene.settings.frames_per_second)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = Model.build(scene, device="cpu")
    check_length(scene.settings.duration, model.time_step, scene.settings.frames_per_second)
    return [" ".join(str(warning.message).split()) for warning in caught if warning.category is UserWarning]


def _check_rate(rate: float) -> None:
    """Refuse frames per second that are none."""
    if not (np.isfinite(rate) and rate > 0.0):
        raise InputError(f"frames per second is {rate:g}; allowed: above 0")


def check_length(duration: float, step: float, rate: float) -> None:
    """Refuse frames that come faster than steps, and a run that is over before it starts or never ends.

    Args:
        duration: Of the run [s].
        step: Time step [s].
        rate: Frames per second.

    Raises:
        InputError: One line.
    """
    if 1.0 / rate < step:
        raise InputError(f"frames per second is {rate:g}; allowed: up to one per time step, {1.0 / step:.6g}")
    if not duration / step <= MOST_STEPS:
        raise InputError(
            f"duration is {duration:g} s at a time step of {step:.6g} s, {duration / step:.3g} steps; "
            f"allowed: up to {MOST_STEPS:g} steps"
        )
    if round(duration / step) < 1:
        raise InputError(f"duration is {duration:g} s; allowed: at least one time step, {step:.6g} s")
    # as much less than a frame as frame_steps forgives
    if duration * rate < 1.0 - 1e-9:
        raise InputError(
            f"duration is {duration:g} s; allowed: at least one frame, {1.0 / rate:.6g} s at {rate:g} frames per second"
        )


def _check_checkpoint(path: Path, folder: Path) -> None:
    """Find out before the run whether its end can be saved; the run's own folder is still to be made."""
    inside = path.absolute().parent == folder.absolute()
    if inside and path.name in FILES:
        raise InputError(f"checkpoint is {path}, a file of the run; allowed: another name")
    if path.parent.is_dir() or not inside:
        check_place(path, "checkpoint")


def frame_steps(duration: float, rate: float, time_step: float, *, first: int = 0) -> Iterator[int]:
    """Steps at which frames are taken: those nearest to the frames' times, and the last step of the run.

    Args:
        duration: Simulated time at the end [s].
        rate: Frames per second.
        time_step: [s].
        first: Step from which the run goes on; only later ones are given.
    """
    last, step = round(duration / time_step), first
    for frame in range(max(1, math.floor(first * time_step * rate)), math.floor(duration * rate + 1e-9) + 1):
        stop = min(round(frame / rate / time_step), last)
        if stop > step:
            yield stop
            step = stop
    if last > step:
        yield last


def _frames(sim: Simulation, recorder: Recorder, rate: float, progress: Callable[[float, float], None] | None) -> None:
    """Step from frame to frame until the scene's duration."""
    started = clock.perf_counter()
    recorder.write(capture_frame(sim))
    if progress is not None:
        progress(sim.time, 0.0)
    for stop in frame_steps(sim.scene.settings.duration, rate, sim.time_step, first=sim.state.step):
        sim.step(stop - sim.state.step)
        recorder.write(capture_frame(sim))
        if progress is not None:
            progress(sim.time, clock.perf_counter() - started)
