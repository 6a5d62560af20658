"""`FileCamera`: images that were taken before, played at their times: a folder, a TIFF of pages, `.npy`, or a video."""

from __future__ import annotations

import csv
import dataclasses
import itertools
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.perception.camera import CameraFrame, CameraInfo, CameraLost, Piece, Region
from otwarp.vision.stack import READ, load_stack, size_of

TIMES = "times.csv"
"""Of a folder: a line for each image, its name and when its light was [s]."""

FEW_BITS = 12
"""Of cameras that leave the highest bits of 16 empty: of levels below these the highest 8 bits hold 16 at most."""

ABOUT = "a folder of images, a TIFF, .npy or video"
"""What it plays."""

VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".webm")


def grey(image: np.ndarray, where: str, bits: int = 16) -> np.ndarray:
    """(height, width) uint8 of an image: of more than 8 bits the highest 8.

    Args:
        image: (height, width) uint8 or uint16.
        where: It is from, for the message.
        bits: Of a level where images are uint16, in which cameras of 10 or 12 bits leave the highest ones empty.

    Raises:
        InputError: Numbers that are no grey levels, or that have more bits.
    """
    if image.dtype == np.uint16:
        if image.size and int(image.max()) >> bits:
            raise InputError(f"{where}: levels go up to {int(image.max())}; allowed with {bits} bits: {2**bits - 1}")
        return (image >> (bits - 8)).astype(np.uint8)
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
        bits: Of a grey level, in images of 16 bits; None for 16, if that can be.

    Raises:
        InputError: A rate, a shift or bits that cannot be.
    """

    def __init__(
        self,
        where: str,
        *,
        name: str = "",
        rate: float | None = None,
        loop: int = 0,
        shift: float = 0.0,
        bits: int | None = None,
    ):
        if rate is not None and not 0.01 <= rate <= 10_000.0:
            raise InputError(f"--camera {name}: rate is {rate:g}; allowed: 0.01 to 10000 images per second")
        if not math.isfinite(shift):
            raise InputError(f"--camera {name}: shift is {shift:g}; allowed: a finite time in seconds")
        if bits is not None and not 9 <= bits <= 16:
            raise InputError(f"--camera {name}: bits is {bits}; allowed: 9 to 16, of images of 16 bits")
        self._where, self._rate, self._loop, self._shift = Path(where), rate, bool(loop), shift
        self._bits = bits
        self._info = CameraInfo(name=name or where, kind="files")
        self._images: list[np.ndarray | Path] = []
        self._times: list[float] = []
        self._due: list[float] = []
        self._start: float | None = None
        self._at = self._number = 0

    @property
    def info(self) -> CameraInfo:
        """See `Camera`."""
        return self._info

    def open(self) -> None:
        """See `Camera`."""
        self._images.clear()
        if not self._where.exists():  # before its ending is judged, which a folder does not have
            raise InputError(f"{self._where}: there is no such file or folder; allowed: {ABOUT}")
        if self._where.is_dir():
            names = sorted(p for p in self._where.iterdir() if p.suffix.lower() in READ)
            self._images.extend(names)
            if not names:
                raise InputError(f"{self._where}: holds no image; allowed: {', '.join(READ)}")
            page = load_stack(names[0])[:1]  # what nobody can read, or differs from it, is refused now
            self._check_bits(page, names[0])
            first = self._grey(page[0], names[0])
            _check_sizes(names)
            self._times = self._stamps(names)
        else:
            pages, rate = (
                _video(self._where) if self._where.suffix.lower() in VIDEOS else (load_stack(self._where), None)
            )
            self._check_bits(pages, self._where)
            levels = [self._grey(page, self._where) for page in pages]
            self._images.extend(levels)
            first = levels[0]
            self._times = self._even(self._rate or rate or 100.0)
        self._info = dataclasses.replace(self._info, size=(first.shape[1], first.shape[0]))
        # stamps may go back, images come in their order
        self._due = list(itertools.accumulate(self._times, max))

    def aim(self, regions: Sequence[Region]) -> None:
        """See `Camera`: files have whole frames."""

    def read(self, now: float) -> CameraFrame | None:
        """See `Camera`."""
        if self._start is None:
            self._start = now
        due = self._at
        while due < len(self._due) and self._start + self._due[due] <= now:
            due += 1
        if due == self._at:
            if due == len(self._times):
                return self._ended(now)
            return None
        self._number += due - self._at
        self._at = due
        image = self._images[due - 1]
        levels = image if isinstance(image, np.ndarray) else self._read(image)
        time = self._start + self._times[due - 1] - self._shift
        return CameraFrame(number=self._number, time=time, exposure=0.0, pieces=(Piece(0, 0, levels),), sent=now)

    def _read(self, file: Path) -> np.ndarray:
        """The image of a file, which may have gone or be damaged where nothing told so at the beginning."""
        try:
            return self._grey(load_stack(file)[0], file)
        except InputError as error:
            raise CameraLost(f"camera {self._info.name}: {error}") from None

    def close(self) -> None:
        """See `Camera`."""
        self._images.clear()

    def _ended(self, now: float) -> None:
        if not self._loop or not self._times:
            raise CameraLost(f"camera {self._info.name} has ended after {self._number} images")
        self._start, self._at = now, 0

    def _grey(self, image: np.ndarray, file: Path) -> np.ndarray:
        return grey(image, str(file), self._bits or 16)

    def _check_bits(self, pages: Sequence[np.ndarray] | np.ndarray, file: Path) -> None:
        """Refuse images of 16 bits that look like those of a camera of fewer: of their levels next to none would stay.

        Raises:
            InputError: They do, and nobody has said how many bits they have.
        """
        top = max(int(page.max()) for page in pages)
        if self._bits is None and pages[0].dtype == np.uint16 and top < 2**FEW_BITS:
            raise InputError(f"{file}: levels go up to {top} of the 65535 of 16 bits; allowed: say how many bits they "
                             f"have, as ,bits={FEW_BITS} after the path, or ,bits=16 if it is so dark")  # fmt: skip

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
        first: dict[float, str] = {}
        for p, time in zip(names, times, strict=True):
            if (other := first.setdefault(time, p.name)) != p.name:
                raise InputError(f"{file}: {other} and {p.name} have the same time, {time:g} s, so that one would "
                                 "never be shown; allowed: a time of its own for each image")  # fmt: skip
        return [t - times[0] for t in times]


def _check_sizes(names: Sequence[Path]) -> None:
    """Refuse a folder of images that differ in size or are cut off, before anything runs; damage within shows later.

    Raises:
        InputError: They do or are, or one cannot be read.
    """
    (wide, high), *others = map(size_of, names)
    for name, size in zip(names[1:], others, strict=True):
        if size != (wide, high):
            raise InputError(f"{name}: is {size[0]} × {size[1]} pixels; allowed: {wide} × {high}, as {names[0].name}")


def hush_opencv() -> None:
    """Before OpenCV is imported: no lines of its own or of FFmpeg beside ours, unless the environment asks for them."""
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")


def _video(file: Path) -> tuple[list[np.ndarray], float | None]:
    """Frames of a video as grey levels, row 0 the lowest, and its rate, by imageio or OpenCV."""
    if not file.is_file():
        raise InputError(f"{file}: there is no such file; allowed: a video")
    hush_opencv()
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
            f"{file}: a video needs OpenCV or imageio: pip install 'otwarp[cameras]', or imageio[ffmpeg]"
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
