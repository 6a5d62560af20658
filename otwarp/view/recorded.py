"""A recorded run, read from disk where it is looked at: a moment costs the same however long the run is.

The numbers are those of `run.nc`, mapped into memory and never read as a whole; what is drawn is the scene of the
`run.usda` beside it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.record.folder import ALLOWED, mapped, warn_early
from otwarp.record.netcdf import QUANTITIES
from otwarp.scene import Scene
from otwarp.simulation.frame import SHAPES
from otwarp.teleop.page.protocol import PageFrame
from otwarp.view.source import Moments, page_frame

NUMBERS, STAGE = "run.nc", "run.usda"
"""Files of a run."""


class RecordedRun:
    """One world of a run; a `Source`.

    Args:
        path: Its folder, its `run.usda` or its `run.nc`.
        world: Which of its recorded worlds, from 0.

    Raises:
        InputError: No run is there, it was cut off, another version wrote it, or it has no such world or no frame.
    """

    def __init__(self, path: str | Path, world: int = 0):
        numbers, stage = _files(Path(path))
        self.file, self.world = numbers, world
        self._data = _mapped(numbers)
        worlds = int(self._data.dimensions["world"])
        if not 0 <= world < worlds:
            raise InputError(f"{numbers}: world = {world}; allowed: 0 … {worlds - 1}, the recorded ones")
        self.time = np.array(self._data.variables["time"].data, dtype=float)
        if not len(self.time):
            raise InputError(f"{numbers}: frames = 0; allowed: 1 or more")
        self.layout = json.loads(self._data.layout)
        if not stage.is_file():
            raise InputError(f"{stage}: is not beside {numbers.name}; allowed: a run with its {STAGE}, which is drawn")
        self.scene = Scene.load(stage)
        self._check_scene(stage)
        self.title = numbers.resolve().parent.name
        bodies = self._has("trap_body")
        self.held = np.array(self._data.variables["trap_body"].data, dtype=int) if bodies else np.zeros(0, dtype=int)

    @property
    def about(self) -> tuple[tuple[str, str], ...]:
        """See `Source`."""
        data = self._data
        said = {
            "scene": data.scene.decode(),
            "seed": f"{data.seed:.0f}",
            "time step": f"{1e3 * data.time_step:.4g} ms",
            "frames": f"{len(self.time):,}, {data.frames_per_second:g} per second",
            "world": f"{self.world} of {int(data.dimensions['world'])}",
            "temperature": f"{data.temperature:g} K",
            "viscosity": f"{1e3 * data.viscosity:.4g} mPa·s",
            "otwarp": data.otwarp_version.decode(),
        }
        for name in ("integrator", "precision", "device_name"):
            if hasattr(data, name):
                said[name.replace("_", " ")] = getattr(data, name).decode()
        return tuple(said.items())

    def frame(self, index: int) -> PageFrame:
        """See `Source`."""
        return page_frame(index, float(self.time[index]), {name: self._row(name, index) for name in QUANTITIES})

    def moments(self, which: slice) -> Moments:
        """See `Source`."""
        place = "unwrapped" if self._has("unwrapped") else "position"
        position = self._row(place, which) if self._has(place) else self._row("position", which)
        came_in = self._row("entries", which) if self._has("entries") else np.zeros(position.shape[:2])
        return Moments(
            time=self.time[which],
            position=position,
            contact_load=self._row("contact_load", which),
            trap_distance=self._row("trap_distance", which),
            trap_power=self._row("trap_power", which),
            came_in=came_in,
        )

    def close(self) -> None:
        """Let go of the file."""
        self._data.close()

    def _has(self, name: str) -> bool:
        return name in self._data.variables

    def _row(self, name: str, index: int | slice) -> np.ndarray:
        """A variable of this world at a frame or at many; of what the scene lacks, nothing."""
        if self._has(name):
            rows = self._data.variables[name].data[index]
            return np.array(rows[:, self.world] if isinstance(index, slice) else rows[self.world], dtype=float)
        axis, length = SHAPES[name]
        count = len(self.scene.bodies) if axis == "body" else len(self.scene.traps)
        many = (len(self.time[index]),) if isinstance(index, slice) else ()
        return np.zeros((*many, count, length) if length else (*many, count))

    def _check_scene(self, stage: Path) -> None:
        """The scene may have been edited since: then its bodies are not those that were recorded."""
        for what, names in (
            ("body", [b.name for b in self.scene.bodies]),
            ("trap", [t.prim for t in self.scene.traps]),
        ):
            if _labels(self._data, what) != names:
                raise InputError(
                    f"{stage}: its scene has other {what.replace('body', 'bodie')}s than {self.file.name}; "
                    "allowed: the scene as it was when the run was recorded"
                )


def _files(path: Path) -> tuple[Path, Path]:
    """Numbers and stage of a run."""
    if path.is_dir():
        if not (path / NUMBERS).is_file():
            raise InputError(f"{path}: holds no {NUMBERS}; {ALLOWED}")
        return path / NUMBERS, path / STAGE
    if not path.is_file():
        raise InputError(f"{path}: there is no such file or folder; {ALLOWED}")
    if path.suffix == ".nc":
        return path, path.with_suffix(".usda")
    if path.with_suffix(".nc").is_file():
        return path.with_suffix(".nc"), path
    raise InputError(f"{path}: no {path.with_suffix('.nc').name} is beside it; {ALLOWED}")


def _mapped(file: Path) -> Any:
    """A run's numbers, mapped into memory."""
    data = mapped(file)
    _check_version(data, file)
    warn_early(file.parent)
    return data


def _check_version(data: Any, file: Path) -> None:
    """Refuse a file without what this version reads."""
    lacks = [name for name in ("time", "step", "world") if name not in data.variables]
    lacks += [name for name in ("layout", "scene", "seed", "time_step", "otwarp_version") if not hasattr(data, name)]
    for axis in ("body", "trap"):
        if axis in data.dimensions:
            lacks += [name for name in QUANTITIES if SHAPES[name][0] == axis and name not in data.variables]
    if lacks:
        said = getattr(data, "otwarp_version", b"").decode()
        by = f"was written by otwarp {said}, another version than this one" if said else "was not written by otwarp"
        raise InputError(f"{file}: {by}: it has no {lacks[0]}; {ALLOWED}")


def _labels(data: Any, axis: str) -> list[str]:
    """Names along an axis."""
    if axis not in data.variables:
        return []
    rows = np.array(data.variables[axis].data)
    return [bytes(row).rstrip(b"\0").decode() for row in rows]
