"""Checkpoints: a run saved to one file and continued bit for bit, in another process if need be."""

from __future__ import annotations

import dataclasses
import json
import os
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar
from zipfile import BadZipFile

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.body_forces.body_force import BodyForce
from otwarp.kernels.forces.table import FORCES
from otwarp.scene import Scene
from otwarp.scene.digest import scene_digest
from otwarp.simulation import stored_ends
from otwarp.simulation.ends import End
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.state import Control, State
from otwarp.simulation.user_forces import Force

FORMAT = 1
"""Version of the file format."""

PLAIN: dict[str, Any] = {
    f.name: {"integrator": "eulerMaruyama", "noise": "gaussian"}.get(f.name, f.default)
    for f in dataclasses.fields(StepOptions)
    if f.name not in ("forces", "ends", "allow_large_step")
}
"""Options of the step that a checkpoint holds as they are, with what they were before it did. Forces and ends are
functions, and a step that was accepted once is so again, however large."""


class Stepped(Protocol):
    """What a checkpoint needs of a `Simulation`."""

    model: Model
    state: State
    control: Control
    options: StepOptions

    @property
    def scene(self) -> Scene:
        """The scene being simulated."""
        ...

    @property
    def time_step(self) -> float:
        """Time step [s]."""
        ...

    def arrays(self) -> dict[str, wp.array]:
        """All arrays that a run changes, by the names that they have in a checkpoint."""
        ...


Made = TypeVar("Made", bound=Stepped)


def save(sim: Stepped, path: Path) -> Path:
    """Write the state, the commands and how the simulation was made to `path` (`.npz`), atomically.

    Raises:
        InputError: The scene was not loaded from a file, or `path` cannot be written.
    """
    if sim.scene.file is None:
        raise InputError("a checkpoint names its scene file, and this scene was not loaded from one; allowed: save it")
    if sim.model.which is not None:
        raise InputError("checkpoint: the worlds share rows of parameters; allowed: a row for all worlds, or one each")
    about = {
        "format": FORMAT,
        "scene": str(Path(sim.scene.file).resolve()),
        "digest": scene_digest(sim.model.authored),
        "duration": sim.scene.settings.duration,
        "worlds": sim.model.all_worlds,
        "part": [sim.model.first_world, sim.model.first_world + sim.model.worlds],
        "seed": sim.model.seed,
        "step": sim.state.step,
        **{name: getattr(sim.options, name) for name in PLAIN},
        "ends": stored_ends.described(sim.options.ends),
        "forces": [
            {"name": body_force.name, "digest": body_force.digest, "bodies": np.flatnonzero(acts).tolist()}
            for body_force, acts in _user_forces(sim)
        ],
    }
    arrays: dict[str, Any] = {k: v.numpy() for k, v in sim.arrays().items()}
    arrays |= {f"parameter.{k}": v for k, v in sim.model.overrides.items()} | stored_ends.values(sim.options.ends)
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


def _user_forces(sim: Stepped) -> list[tuple[BodyForce, np.ndarray]]:
    """Forces that the user added, and (B,) the bodies that each acts on."""
    own = [row.parametric for row in FORCES.values()]
    pairs = zip(sim.model.forces.body_forces, sim.model.forces.acts, strict=True)
    return [(body_force, acts) for body_force, acts in pairs if body_force not in own]


def _same_forces(path: Path, scene: Scene, stored: list[dict[str, Any]], given: Sequence[Force]) -> tuple[Force, ...]:
    """The forces of a checkpoint, with the functions that are given.

    Raises:
        InputError: One is missing, too many, or another function than the checkpoint's.
    """
    functions = {force.body_force.name: force for force in given}
    wanted = [entry["name"] for entry in stored]
    if sorted(functions) != sorted(wanted):
        made, now = (", ".join(names) or "none" for names in (wanted, functions))
        raise InputError(f"checkpoint {path} was made with forces: {made}; given: {now}")
    for entry in stored:
        digest = functions[entry["name"]].body_force.digest
        stored_ends.check_same(path, f"force {entry['name']}", digest, entry["digest"])
    return tuple(
        Force(
            functions[e["name"]].body_force,
            functions[e["name"]].values,
            tuple(scene.bodies[b].name for b in e["bodies"]),
        )
        for e in stored
    )


def _read(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What a checkpoint says about its run, and its arrays; InputError if it is none."""
    try:
        with path.open("rb") as file, np.lib.npyio.NpzFile(file, allow_pickle=False) as table:
            stored = {k: table[k] for k in table.files}
        about = json.loads(str(stored.pop("about")))
        if about["format"] != FORMAT:
            raise InputError(f"{path} has checkpoint format {about['format']}; allowed: {FORMAT}")
        missing = {"scene", "digest", "duration", "worlds", "seed", "time_step", "step"} - set(about)
        if missing:
            raise KeyError(*sorted(missing))
        if not isinstance(about["step"], int) or about["step"] < 0:
            raise ValueError(f"its step is {about['step']}, and must be a whole number, 0 or more")
    except InputError:
        raise
    except OSError as error:
        allowed = "allowed: a file that `otwarp run --checkpoint` or `Simulation.save` wrote"
        raise InputError(f"checkpoint {path} cannot be read: {error.strerror or error}; {allowed}") from error
    except (BadZipFile, ValueError, KeyError, TypeError, EOFError, NotImplementedError, zlib.error) as error:
        raise InputError(f"{path} is not a readable otwarp checkpoint: {' '.join(str(error).split())}") from error
    return about, stored


def restore(
    make: Callable[..., Made],
    path: Path,
    scene: Scene | None = None,
    *,
    device: str | None = None,
    threads: int | None = None,
    forces: Sequence[Force] = (),
    ends: Sequence[End] | None = None,
) -> Made:
    """Make the simulation that `save` wrote.

    Args:
        make: `Simulation`.
        path: The checkpoint.
        scene: The scene it continues, where only the duration may differ; None loads it from its file.
        device, threads: As for `Simulation`.
        forces: The functions of the forces that the user had added, in any order; parameters are the checkpoint's.
        ends: Likewise the functions of the user's own ends.

    Raises:
        InputError: Not a checkpoint, of another format, or its scene, its forces or its ends have changed.
    """
    about, stored = _read(path)
    if scene is None:
        scene = Scene.load(about["scene"], duration=about["duration"])
    if scene_digest(scene) != about["digest"]:
        raise InputError(f"checkpoint {path} continues {about['scene']} as it was then; scene {scene.file} differs")
    parameters = {k.removeprefix("parameter."): v for k, v in stored.items() if k.startswith("parameter.")}
    part = about.get("part", [0, about["worlds"]])
    sim = make(
        scene,
        part=None if part == [0, about["worlds"]] else tuple(part),
        ends=stored_ends.restored(path, about.get("ends"), stored, ends),
        worlds=about["worlds"],
        seed=about["seed"],
        device=device,
        parameters=parameters,
        threads=threads,
        forces=_same_forces(path, scene, about.get("forces", []), forces),
        allow_large_step=True,
        **{name: about.get(name, default) for name, default in PLAIN.items()},
    )
    _fill(sim, stored, path)
    sim.state.step = about["step"]
    sim.state.time = about["step"] * sim.time_step
    return sim


def _fill(sim: Stepped, stored: Mapping[str, np.ndarray], path: Path) -> None:
    """Put the arrays of a checkpoint into a simulation.

    Raises:
        InputError: One is missing, of another shape, or a pose that is none.
    """
    for name in ("trap_position", "trap_power"):
        # commands that had come to differ from world to world need their rows back
        if stored.get(f"control.{name}", np.zeros(())).shape[:1] == (sim.model.worlds,):
            sim.control.widen(name)
    for name, array in sim.arrays().items():
        # what this simulation does not use may be younger than the file
        if not array.size:
            continue
        if name not in stored or stored[name].shape[: array.ndim] != array.shape:
            raise InputError(f"{path} is not a readable otwarp checkpoint: its array {name} is missing or misshapen")
        # bodies with a fault keep their last good pose, so that no run has saved any other
        if name in ("state.position", "state.orientation") and not np.isfinite(stored[name]).all():
            raise InputError(f"{path} is not a readable otwarp checkpoint: its array {name} has numbers that are none")
        array.assign(stored[name])
