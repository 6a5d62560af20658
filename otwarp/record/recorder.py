"""`Recorder`: takes the frames of a run and keeps its folder readable at every moment."""

from __future__ import annotations

import logging
import shutil
import time as clock
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import check_place
from otwarp.record.folder import earlier_run
from otwarp.record.interrupts import interrupts_wait
from otwarp.record.method import Method
from otwarp.record.monitor import Monitor
from otwarp.record.netcdf import LARGEST_RECORD, NetcdfRecording, check_size
from otwarp.record.summary import summarize, write_json
from otwarp.scene import Scene
from otwarp.simulation.frame import Frame

FILES = ("run.usda", "trajectory.usdc", "trajectory", "run.nc", "summary.json", "figure.png")
"""What a run leaves in its folder (`trajectory/` only while it goes on); nothing else there is ever touched."""

LOG = logging.getLogger("otwarp.record")

REFRESH = 2.0
"""Wall time between two updates of `summary.json` [s]."""


class Recorder:
    """Writes a run into a folder, frame by frame: `run.usda`, `run.nc`, `summary.json` and, at the end, `figure.png`.

    Memory does not grow with the length of the run. A program that is killed leaves files that open: `run.nc` has
    every frame that was written, `run.usda` every one that was flushed (see `otwarp.scene.recording`), `summary.json`
    says `running`. Ctrl-C and SIGTERM wait until a frame is in all of them. An earlier run in the folder is removed,
    all of it, when the first frame comes.

    Args:
        scene: What is being run.
        folder: Where to write; made when it does not exist.
        frames_per_second: Frames per simulated second.
        held: Per trap the index of the body it holds and of the sphere in it, -1 for none (`Model.held`).
        time_step: [s].
        seed: Key of the random streams.
        worlds: Worlds kept in `run.nc`: the first so many; None keeps all.
        usd_world: World written as USD and drawn in the figure; None writes no USD.
        forces: Whether force arrows go into the USD.
        arrow_scale: Length of a force arrow [µm/pN]; None for the default.
        figure: Whether `figure.png` is drawn at the end.
        method: How the run is computed (`Method.of(sim.model)`): the files say so, and `run.nc` has its precision. None
            says nothing, and `run.nc` is float32.

    Raises:
        InputError: The folder cannot be written, or an argument is out of range; nothing has been written.

    Example:
        with Recorder(scene, "out/run", frames_per_second=60.0, held=sim.model.held, time_step=sim.time_step) as out:
            out.write(frame)
    """

    def __init__(
        self,
        scene: Scene,
        folder: str | Path,
        *,
        frames_per_second: float,
        held: Sequence[tuple[int, int]],
        time_step: float,
        seed: int = 0,
        worlds: int | None = None,
        usd_world: int | None = 0,
        forces: bool = False,
        arrow_scale: float | None = None,
        figure: bool = True,
        method: Method | None = None,
        errors: Mapping[str, float] | None = None,
    ):
        if not (np.isfinite(frames_per_second) and frames_per_second > 0.0):
            raise InputError(f"frames per second = {frames_per_second:g}; allowed: above 0")
        if worlds is not None and worlds < 1:
            raise InputError(f"recorded worlds = {worlds}; allowed: 1 or more")
        if usd_world is not None and usd_world < 0:
            raise InputError(f"USD world = {usd_world}; allowed: 0 or more")
        if arrow_scale is not None and not (np.isfinite(arrow_scale) and arrow_scale > 0.0):
            raise InputError(f"arrow scale = {arrow_scale:g} µm/pN; allowed: above 0")
        if len(held) != len(scene.traps):
            raise ValueError(f"held has {len(held)} entries; allowed: one per trap, {len(scene.traps)}")
        self.scene, self.folder, self.held, self.figure = scene, Path(folder), held, figure
        self.rate, self.time_step, self.seed, self.method = frames_per_second, time_step, seed, method
        self.errors = dict(errors or {})
        self._kept, self._usd_world = worlds, usd_world
        self._status, self._frames, self._closed = "running", 0, False
        self._warnings: list[str] = []
        self._netcdf: NetcdfRecording | None = None
        self._begun = self._failed = False
        self._made: list[Path] = []
        self.summary: dict[str, Any] = {}
        check_folder(self.folder, scene.file)
        self._usd = None
        if usd_world is not None:
            from otwarp.scene.drawing.unlike import unlike_file
            from otwarp.scene.recording.usd import ARROW_SCALE, UsdRecording

            scale = ARROW_SCALE if arrow_scale is None else arrow_scale
            self._usd = UsdRecording(
                scene,
                frames_per_second=self.rate,
                held=held,
                time_step=time_step,
                world=usd_world,
                forces=forces,
                arrow_scale=scale,
            )
            if other := unlike_file(scene):
                self.warn(f"run.usda has {other}")

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            self.stop(" ".join(str(error).split()) or ("interrupted" if kind is KeyboardInterrupt else kind.__name__))  # type: ignore[union-attr]
        try:
            self.close()
        except OSError:
            # what ended the run says more than what then went wrong with its files
            if error is None:
                raise

    def warn(self, text: str) -> None:
        """Put a sentence among the warnings of the summary."""
        self._warnings.append(text)

    def stop(self, reason: str) -> None:
        """Say why the run ends early; the first reason stays."""
        if self._status == "running":
            self._status = f"stopped: {reason}"

    def write(self, frame: Frame) -> None:
        """Take one frame; frames come in order of time.

        Raises:
            ValueError: The frame does not fit the scene or the frames before it.
            OSError: The disk is full, or the folder has gone.
        """
        if self._closed:
            raise ValueError("this recorder is closed; allowed: frames before close()")
        if self._frames:
            frame.check(self.scene, self._worlds)
            if frame.time <= self._last.time:
                raise ValueError(f"frame time is {frame.time:g} s; allowed: above {self._last.time:g} s")
        with interrupts_wait():
            try:
                self._write(frame)
            except OSError:
                self._failed = True
                raise

    def _write(self, frame: Frame) -> None:
        if not self._begun:
            self._begin(frame)
        assert self._netcdf is not None
        self._netcdf.write(frame)
        if self._usd is not None:
            self._usd.write(frame)
        self.monitor.update(frame)
        self._last, self._frames = frame, self._frames + 1
        if self._frames == 1 or clock.perf_counter() - self._refreshed >= REFRESH:
            self._refresh()

    def close(self) -> None:
        """Finish all files and draw the figure; without a whole frame, leave none. Safe to call twice.

        Raises:
            OSError: The disk is full, or the folder has gone; what could be finished is.
        """
        if self._closed:
            return
        self._closed = True
        if not self._frames:
            self._discard()
            return
        with interrupts_wait():
            self._finish()
        if self.figure and not self._failed:
            from otwarp.record.figure import draw

            draw(self.folder, world=min(self._usd_world or 0, self._recorded - 1))

    def _finish(self) -> None:
        """Finish the files that end with the last frame."""
        assert self._netcdf is not None
        problems: list[OSError] = []
        for finish in (self._netcdf.close, self._usd.close if self._usd is not None else None):
            try:
                if finish is not None:
                    finish()
            except OSError as error:
                problems.append(error)
                self.stop(" ".join(str(error).split()))
        if self._status == "running":
            self._status = "finished"
        try:
            self._refresh()
        except OSError as error:
            problems.append(error)
        if problems:
            raise problems[0]

    def _discard(self) -> None:
        """Remove what was begun for a first frame that never became whole."""
        if not self._begun:
            return
        if self._netcdf is not None:
            self._netcdf.close()
        if self._usd is not None:
            self._usd.abandon()
        try:
            _remove_run(self.folder)
            for folder in self._made:
                folder.rmdir()
        except OSError:
            pass  # the folder has gone, or somebody else has put something there

    def _begin(self, frame: Frame) -> None:
        """Everything that depends on the number of worlds, then the change from the earlier run to this one."""
        frame.check(self.scene)
        self._worlds = frame.worlds
        self._recorded = self._kept or self._worlds
        if self._usd_world is not None and self._usd_world >= self._worlds:
            raise InputError(f"USD world = {self._usd_world}; allowed: 0 … {self._worlds - 1}")
        if self._kept is not None and self._kept > self._worlds:
            raise InputError(f"recorded worlds = {self._kept}; allowed: 1 to {self._worlds}, the worlds of the run")
        if check_size(self.scene, self._recorded, self.method) > LARGEST_RECORD:
            most = LARGEST_RECORD // check_size(self.scene, 1, self.method)
            raise InputError(
                f"recorded worlds = {self._recorded}; allowed: at most {most} (4 GiB per variable and frame)"
            )
        self.monitor = Monitor(self.scene, self.held, self._worlds)
        self._made = [f for f in (self.folder, *self.folder.parents) if not f.exists()]
        self._begun = True
        self.folder.mkdir(parents=True, exist_ok=True)
        if was := earlier_run(self.folder):
            LOG.info("%s: replaces an earlier run (%s)", self.folder, was)
        _remove_run(self.folder)
        self._started = self._refreshed = clock.perf_counter()
        self._first_time = frame.time
        self._netcdf = NetcdfRecording(
            self.folder / "run.nc",
            self.scene,
            self.monitor,
            worlds=self._recorded,
            total_worlds=self._worlds,
            seed=self.seed,
            time_step=self.time_step,
            frames_per_second=self.rate,
            method=self.method,
        )
        if self._usd is not None:
            self._usd.begin(self.folder)

    def _refresh(self) -> None:
        facts = {
            "status": self._status,
            "worlds": self._worlds,
            "recorded_worlds": self._recorded,
            "seed": self.seed,
            "time_step_s": self.time_step,
            "time_step_errors": self.errors,
            "method": None if self.method is None else self.method.facts(),
            "steps": self._last.step,
            "frames": self._frames,
            "duration_s": self._last.time - self._first_time,
            "asked_s": self.scene.settings.duration - self._first_time,
            "wall_time_s": clock.perf_counter() - self._started,
            "warnings": self._warnings,
        }
        self.summary = summarize(self.scene, self.monitor, facts)
        write_json(self.folder / "summary.json", self.summary)
        self._refreshed = clock.perf_counter()


def check_folder(folder: Path, scene_file: Path | None = None) -> None:
    """Find out whether a folder can be written, leaving no trace.

    Args:
        folder: Where a run is to be written.
        scene_file: The scene; it must not be among the files that the run would replace.

    Raises:
        InputError: It cannot, in one line.
    """
    check_place(folder, "output folder", folder=True)
    if scene_file is not None:
        inside = folder.resolve() in (at := scene_file.resolve()).parents
        if inside and at.relative_to(folder.resolve()).parts[0] in FILES:
            raise InputError(
                f"output folder is {folder}, which holds the scene {at.name}, to be replaced; allowed: another folder"
            )


def _remove_run(folder: Path) -> None:
    """Remove an earlier run: first the root layer that leads to the rest; parts left by a killed program as well."""
    for name in FILES:
        for path in (folder / name, *folder.glob(f".{Path(name).stem}*.part*")):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
