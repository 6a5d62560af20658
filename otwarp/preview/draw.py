"""A picture or a movie of a stage, or of a recorded run: the one call behind `otwarp preview`."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from otwarp.errors import InputError, PlausibilityWarning
from otwarp.files import check_place
from otwarp.preview.annotate import annotate
from otwarp.preview.image import save_png
from otwarp.preview.render import render
from otwarp.preview.studio import PictureStyle
from otwarp.preview.video import CODECS, check_video, write_movie
from otwarp.record.folder import SUMMARY, warn_early
from otwarp.scene.appearance.missing import with_missing_looks
from otwarp.scene.drawing.drawables import has_purpose, read_drawables
from otwarp.scene.drawing.files import stage_file
from otwarp.scene.read.source import open_stage

if TYPE_CHECKING:
    from pxr import Usd


@dataclass(frozen=True)
class Film:
    """An open stage and its frames: time code = start + index, index from 0 to count − 1."""

    stage: Usd.Stage
    name: str
    start: float
    count: int

    def time_code(self, frame: int | None, time: float | None) -> float | None:
        """Time code of a frame index, or of a time [s] from the first frame; None for an unanimated stage.

        Raises:
            InputError: Both given, or no such frame or time.
        """
        if frame is not None and time is not None:
            raise InputError(f"{self.name}: frame = {frame} and time = {time:g}, only one of them allowed")
        if frame is not None:
            if not 0 <= frame < self.count:
                raise InputError(f"{self.name}: frame = {frame}, allowed [0, {self.count - 1}]")
            return self.start + frame
        if time is not None:
            rate, last = self.stage.GetTimeCodesPerSecond(), self.count - 1
            if not (math.isfinite(time) and 0.0 <= time * rate <= last + 1e-6):
                raise InputError(f"{self.name}: time = {time:g} s, allowed [0, {last / rate:g}]")
            return self.start + time * rate
        return self.start if self.count > 1 else None


def open_film(path: str | Path) -> Film:
    """Open a stage, or the `run.usda` of the folder of a recorded run.

    Raises:
        InputError: No such file or folder, no run in the folder, or not USD.
    """
    path = stage_file(path)
    stage = with_missing_looks(open_stage(path))
    start, end = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    animated = stage.HasAuthoredTimeCodeRange() and end > start
    if not animated:
        return Film(stage, str(path), 0.0, 1)
    return Film(stage, str(path), start, math.floor(end - start + 1e-6) + 1)


def _picture(
    film: Film, code: float | None, *, look: PictureStyle, camera: str | None, forces: bool, device: str | None
) -> np.ndarray:
    """One picture (h, w, 3) uint8 of a time code, with scale bar and time stamp."""
    purposes = ("default", "render", "guide") if forces else ("default", "render")
    drawables = read_drawables(film.stage, code, camera=camera, purposes=purposes)
    time = None if code is None else (code - film.start) / film.stage.GetTimeCodesPerSecond()
    pixel_size = drawables.view.pixel_size(look.width, look.height)
    return annotate(render(drawables, look, device), pixel_size=pixel_size, time=time)


def movie_codes(film: Film, fps: float, most: int) -> list[float]:
    """Time codes of a movie: in real time at `fps` pictures per second, in time lapse if that takes more than `most`.

    The first and the last picture show the start and, to within a step, the end.
    """
    step = max(1.0, film.stage.GetTimeCodesPerSecond() / fps, (film.count - 1) / max(most - 1, 1))
    return [film.start + step * k for k in range(int((film.count - 1) / step + 1e-9) + 1)]


def _warn(path: Path, film: Film, forces: bool) -> None:
    """Warn of a run that ended early, and of arrows that are wanted but were not recorded."""
    if path.is_dir() or path.with_name(SUMMARY).is_file():
        warn_early(path if path.is_dir() else path.parent)
    if forces and not has_purpose(film.stage, "guide"):
        text = "no arrows recorded, so none are drawn: run it again with --forces"
        warnings.warn(f"{film.name}: {text}", PlausibilityWarning, stacklevel=3)


def _frames(
    codes: list[float], picture: Callable[[float], np.ndarray], progress: Callable[[int, int], None] | None
) -> Iterator[np.ndarray]:
    """The pictures of a movie, one after the other."""
    for done, code in enumerate(codes):
        if progress is not None:
            progress(done, len(codes))
        yield picture(code)
    if progress is not None:
        progress(len(codes), len(codes))


def _check_file(target: Path, suffixes: tuple[str, ...]) -> None:
    """Fail before the long work on a file that can never be written, or whose name lies about what is in it."""
    if target.suffix not in suffixes:
        raise InputError(f"{target}: suffix = {target.suffix or '(none)'}, allowed {', '.join(suffixes)}")
    check_video(target)
    check_place(target, "picture")


def _check_asked(out: str | Path | None, movie: str | Path | None, frame: int | None, time: float | None) -> None:
    """Fail on what cannot be drawn or written, whatever there is to see."""
    if out is None and movie is None:
        raise InputError("preview: neither a picture (-o FILE.png) nor a movie (--movie FILE.gif) was asked for")
    if out is None and (frame is not None or time is not None):
        name, value = ("frame", f"{frame}") if frame is not None else ("time", f"{time:g} s")
        raise InputError(f"preview: {name} = {value} with a movie, which shows the whole run; allowed: with a picture")
    for target, suffixes in ((out, (".png",)), (movie, (".gif", *CODECS))):
        if target is not None:
            _check_file(Path(target), suffixes)


def preview(
    path: str | Path,
    out: str | Path | None = None,
    *,
    frame: int | None = None,
    time: float | None = None,
    size: tuple[int, int] = (1280, 720),
    camera: str | None = None,
    movie: str | Path | None = None,
    fps: float = 20.0,
    most_frames: int = 150,
    progress: Callable[[int, int], None] | None = None,
    forces: bool = False,
    style: str = "dark",
    samples: int = 3,
    device: str | None = None,
) -> list[Path]:
    """Draw a stage, or a frame of a recorded run, and write it as PNG; or the whole run as GIF, MP4 or WebM.

    Args:
        path: USD stage, or folder of a recorded run (holding `run.usda`).
        out: PNG to write.
        frame: Frame index: time code counted from the stage's start; the first one without it.
        time: Seconds from the first frame, instead of `frame`.
        size: Width and height in pixels.
        camera: Path or name of a camera; without it the first one of the stage, or one that frames the scene.
        movie: GIF, MP4 or WebM to write, in real time or, if that took more than `most_frames` pictures, in time lapse.
        fps: Pictures per second of the movie.
        most_frames: Largest number of pictures in the movie.
        progress: Called with (pictures done, pictures in all) while the movie is made.
        forces: Draw prims of USD purpose `guide` as well, such as force arrows so recorded.
        style: Background: `dark`, `light` or `white`.
        samples: Samples per pixel along each side.
        device: Warp device; None for the best there is.

    Returns:
        Files written.

    Raises:
        InputError: Anything in the arguments or files that cannot be accepted, in one line.

    Warns:
        PlausibilityWarning: The run ended early, or no arrows were recorded.
    """
    _check_asked(out, movie, frame, time)
    film = open_film(path)
    _warn(Path(path), film, forces)
    look = PictureStyle(width=size[0], height=size[1], samples=samples, style=style)
    picture = partial(_picture, film, look=look, camera=camera, forces=forces, device=device)
    if movie is not None and (least := min(film.count, most_frames)) < 2:
        raise InputError(f"{film.name}: a movie of {least} frames, allowed [2, inf)")
    written = [] if out is None else [save_png(picture(film.time_code(frame, time)), out)]
    if movie is not None:
        write_movie(_frames(movie_codes(film, fps, most_frames), picture, progress), movie, fps)
        written.append(Path(movie))
    return written
