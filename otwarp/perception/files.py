"""`FileCamera`: images that were taken before, played at their times: a folder, a TIFF of pages, `.npy`, or a video."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.perception.camera import CameraFrame, CameraInfo, CameraLost, Piece, Region
from otwarp.vision.stack import READ, load_stack

TIMES = "times.csv"
"""Of a folder: a line for each image, its name and when its light was [s]."""

VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".webm")


def grey(image: np.ndarray, where: str) -> np.ndarray:
    """(height, width) uint8 of an image with row 0 the lowest: 16 bits lose their lower half.

    Raises:
        InputError: Numbers that are no grey levels.
    """
    if image.dtype == np.uint16:
        return (image >> 8).astype(np.uint8)
    if image.dtype != np.uint8:
        raise InputError(f"{where}: levels are {image.dtype}; allowed: uint8 or uint16")
    return image


class FileCamera:
    """A camera that plays files.

    Args:
        where: A folder, or a file.
        name: As the user named it.
        rate: Images per second where nothing says their times; None: as the video says, else 100.
        loop: Whether it begins again at the end.
        shift: Seconds by which all stamps are late, to see what a clock that is wrong does.

    Raises:
        InputError: A rate that cannot be.
    """

    def __init__(self, where: str, *, name: str = "", rate: float | None = None, loop: int = 0, shift: float = 0.0):
        if rate is not None and not 0.01 <= rate <= 10_000.0:
            raise InputError(f"--camera {name}: rate is {rate:g}; allowed: 0.01 to 10000 images per second")
        self._where, self._rate, self._loop, self._shift = Path(where), rate, bool(loop), shift
        self._info = CameraInfo(name=name or where, kind="files")
        self._images: list[np.ndarray | Path] = []
        self._times: list[float] = []
        self._start: float | None = None
        self._at = self._round = self._number = 0

    @property
    def info(self) -> CameraInfo:
        """See `Camera`."""
        return self._info

    def open(self) -> None:
        """See `Camera`."""
        if self._where.is_dir():
            names = sorted(p for p in self._where.iterdir() if p.suffix.lower() in READ)
            self._images = list(names)
            if not names:
                raise InputError(f"{self._where}: holds no image; allowed: {', '.join(READ)}")
            grey(load_stack(names[0])[0], str(names[0]))  # what nobody can read is refused now
            self._times = self._stamps(names)
        else:
            pages, rate = (
                _video(self._where) if self._where.suffix.lower() in VIDEOS else (load_stack(self._where), None)
            )
            self._images = [grey(page, str(self._where)) for page in pages]
            self._times = self._even(self._rate or rate or 100.0)

    def aim(self, regions: Sequence[Region]) -> None:
        """See `Camera`: files have whole frames."""

    def read(self, now: float) -> CameraFrame | None:
        """See `Camera`."""
        if self._start is None:
            self._start = now
        due = self._at
        while due < len(self._times) and self._due(due) <= now:
            due += 1
        if due == self._at:
            if due == len(self._times):
                return self._ended(now)
            return None
        self._number += due - self._at
        self._at = due
        image = self._images[due - 1]
        levels = image if isinstance(image, np.ndarray) else grey(load_stack(image)[0], str(image))
        time = self._start + self._round + self._times[due - 1] - self._shift
        return CameraFrame(number=self._number, time=time, exposure=0.0, pieces=(Piece(0, 0, levels),), sent=now)

    def close(self) -> None:
        """See `Camera`."""
        self._images.clear()

    def _due(self, n: int) -> float:
        """When an image is there: stamps may go back, images come in their order."""
        assert self._start is not None
        return self._start + self._round + max(self._times[: n + 1])

    def _ended(self, now: float) -> None:
        if not self._loop or not self._times:
            raise CameraLost(f"camera {self._info.name} has ended after {self._number} images")
        assert self._start is not None
        self._start, self._at = now, 0

    def _even(self, rate: float) -> list[float]:
        return [n / rate for n in range(len(self._images))]

    def _stamps(self, names: Sequence[Path]) -> list[float]:
        """Times of the images of a folder, as its `times.csv` says."""
        file = self._where / TIMES
        if not file.is_file():
            return self._even(self._rate or 100.0)
        try:
            with file.open(newline="", encoding="utf-8") as lines:
                told = {row[0]: float(row[1]) for row in csv.reader(lines) if row and not row[0].startswith("#")}
            times = [told[p.name] for p in names]
        except (OSError, ValueError, IndexError) as error:
            raise InputError(f"{file}: cannot be read ({error}); allowed: NAME,SECONDS in each line") from None
        except KeyError as error:
            raise InputError(f"{file}: says no time of {error.args[0]}; allowed: all images of the folder") from None
        if not all(math.isfinite(t) for t in times):
            raise InputError(f"{file}: has a time that is not finite; allowed: seconds")
        return [t - times[0] for t in times]


def _video(file: Path) -> tuple[list[np.ndarray], float | None]:
    """Frames of a video as grey levels, row 0 the lowest, and its rate, by imageio or OpenCV."""
    if not file.is_file():
        raise InputError(f"{file}: there is no such file; allowed: a video")
    try:
        import cv2  # type: ignore[import-not-found]
    except ImportError:
        return _by_imageio(file)
    opened = cv2.VideoCapture(str(file))
    pages = []
    while True:
        there, image = opened.read()
        if not there:
            break
        pages.append(_luminance(image[..., ::-1]))
    rate = float(opened.get(cv2.CAP_PROP_FPS)) or None
    opened.release()
    if not pages:
        raise InputError(f"{file}: OpenCV finds no frames in it; allowed: a video")
    return pages, rate


def _by_imageio(file: Path) -> tuple[list[np.ndarray], float | None]:
    try:
        import imageio.v3 as imageio
    except ImportError:
        raise InputError(
            f"{file}: a video needs OpenCV or imageio; install opencv-python-headless, or imageio[ffmpeg]"
        ) from None
    try:
        about: dict[str, Any] = imageio.immeta(file)
        pages = [_luminance(image) for image in imageio.imiter(file)]
    except (OSError, ValueError, ImportError, RuntimeError) as error:
        raise InputError(f"{file}: cannot be read ({str(error).splitlines()[0][:120]}); allowed: a video") from None
    if not pages:
        raise InputError(f"{file}: has no frames; allowed: a video")
    return pages, about.get("fps")


def _luminance(image: np.ndarray) -> np.ndarray:
    """Grey levels of a frame whose row 0 is the highest, row 0 the lowest."""
    found = image if image.ndim == 2 else np.rint(image[..., :3].astype(float) @ (0.299, 0.587, 0.114))
    return np.ascontiguousarray(found[::-1].astype(np.uint8))
