"""Checkpoints: a run saved to one file and continued bit for bit, in another process if need be."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.scene.description import Scene

if TYPE_CHECKING:
    from otwarp.simulation.simulation import Simulation

FORMAT = 1
"""Version of the file format."""


def scene_digest(scene: Scene) -> str:
    """Content hash of everything a scene says."""
    with np.printoptions(threshold=2**31, floatmode="unique"):
        return hashlib.sha256(repr(scene).replace(repr(scene.file), "").encode()).hexdigest()


def _arrays(sim: Simulation) -> dict[str, wp.array]:
    groups = {"state": sim.state, "control": sim.control, "readout": sim._readout}
    out = {f"{g}.{k}": v for g, item in groups.items() for k, v in vars(item).items() if isinstance(v, wp.array)}
    return out | {f"stepper.{k}": v for k, v in sim._stepper.extra_state().items()}


def save(sim: Simulation, path: Path) -> Path:
    """Write the state, the commands and how the simulation was made to `path` (`.npz`), atomically.

    Raises:
        InputError: The scene was not loaded from a file, or `path` cannot be written.
    """
    if sim.scene.file is None:
        raise InputError("a checkpoint names its scene file, and this scene was not loaded from one; allowed: save it")
    about = {
        "format": FORMAT,
        "scene": str(Path(sim.scene.file).resolve()),
        "digest": scene_digest(sim.scene),
        "duration": sim.scene.settings.duration,
        "worlds": sim.model.worlds,
        "seed": sim.model.seed,
        "time_step": sim.time_step,
        "step": sim.state.step,
    }
    arrays = {k: v.numpy() for k, v in _arrays(sim).items()}
    arrays |= {f"parameter.{k}": v for k, v in sim.model.overrides.items()}
    temporary = path.with_name(path.name + ".tmp")
    try:
        with temporary.open("wb") as file:
            np.savez(file, about=np.array(json.dumps(about)), **arrays)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise InputError(f"checkpoint {path} cannot be written: {error.strerror}") from error
    return path


def restore(path: Path, *, device: str | None = None, threads: int | None = None) -> Simulation:
    """Make the simulation that `save` wrote.

    Raises:
        InputError: Not a checkpoint, of another format, or its scene has changed.
    """
    from otwarp.simulation.simulation import Simulation

    try:
        with np.load(path, allow_pickle=False) as file:
            stored = {k: file[k] for k in file.files}
        about = json.loads(str(stored.pop("about")))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path} is not a readable otwarp checkpoint: {error}") from error
    if about.get("format") != FORMAT:
        raise InputError(f"{path} has checkpoint format {about.get('format')}; allowed: {FORMAT}")
    scene = Scene.load(about["scene"], duration=about["duration"])
    if scene_digest(scene) != about["digest"]:
        raise InputError(f"scene {about['scene']} has changed since checkpoint {path} was written")
    parameters = {k.removeprefix("parameter."): v for k, v in stored.items() if k.startswith("parameter.")}
    sim = Simulation(
        scene,
        worlds=about["worlds"],
        seed=about["seed"],
        device=device,
        time_step=about["time_step"],
        parameters=parameters,
        threads=threads,
    )
    for name, array in _arrays(sim).items():
        if array.size:
            array.assign(stored[name])
    sim.state.step = about["step"]
    sim.state.time = about["step"] * sim.time_step
    return sim
