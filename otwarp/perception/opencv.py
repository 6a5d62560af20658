"""`DeviceCamera`: a video device through OpenCV (V4L2 on Linux).

The binding was tested against a double; it never met a camera.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.perception.camera import CameraFrame, CameraInfo, CameraLost, Piece, Region
from otwarp.perception.files import grey, hush_opencv


class DeviceCamera:
    """A video device; a thread waits for its frames.

    Args:
        where: Its number, or its path such as `/dev/video0`.
        name: As the user named it.
        rate: Frames per second that it is asked for; None: its own.
        exposure: Exposure time that it is asked for [s]; None: its own.
    """

    def __init__(self, where: str, *, name: str = "", rate: float | None = None, exposure: float | None = None):
        self._where, self._rate, self._exposure = where, rate, exposure
        self._info = CameraInfo(name=name or where, kind="v4l2", stand_in="a double of OpenCV", stamped=False)
        self._opened: Any = None
        self._newest: CameraFrame | None = None
        self._number, self._over, self._ended = 0, False, ""
        self._thread: threading.Thread | None = None

    @property
    def info(self) -> CameraInfo:
        """See `Camera`."""
        return self._info

    def open(self) -> None:
        """See `Camera`."""
        hush_opencv()
        try:
            import cv2  # type: ignore[import-not-found]
        except ImportError:
            raise InputError(f"--camera {self._info.name} needs OpenCV: pip install 'otwarp[cameras]'") from None
        where: int | str = int(self._where) if self._where.isdigit() else self._where
        opened = cv2.VideoCapture(where)
        if not opened.isOpened():
            raise InputError(
                f"--camera {self._info.name}: OpenCV cannot open it; allowed: a video device of this machine"
            )
        # one buffer, or the driver hands out frames that are old
        asked = {"CAP_PROP_BUFFERSIZE": 1.0, "CAP_PROP_FPS": self._rate}
        if self._exposure is not None:
            asked |= {"CAP_PROP_AUTO_EXPOSURE": 1.0, "CAP_PROP_EXPOSURE": self._exposure * 1e4}  # V4L2 counts in 100 µs
        for prop, value in asked.items():
            if value is not None:
                opened.set(getattr(cv2, prop), value)
        self._opened = opened
        self._thread = threading.Thread(target=self._wait, daemon=True, name="camera")
        self._thread.start()

    def aim(self, regions: Sequence[Region]) -> None:
        """See `Camera`: whole frames come."""

    def read(self, now: float) -> CameraFrame | None:
        """See `Camera`."""
        frame, self._newest = self._newest, None
        if frame is None and self._ended:
            raise CameraLost(self._ended)
        return frame

    def close(self) -> None:
        """See `Camera`."""
        self._over = True
        if self._thread is not None:
            self._thread.join(1.0)
        if self._opened is not None:
            self._opened.release()
        self._opened = None

    def _wait(self) -> None:
        """Thread: frames as they come, stamped when they do."""
        exposure = self._exposure or 0.0
        while not self._over:
            try:
                there, image = self._opened.read()
                came = time.perf_counter()
                if not there:
                    self._ended = f"camera {self._info.name} gives no more frames"
                    return
                levels = grey(np.asarray(image if image.ndim == 2 else image[..., 0]), self._info.name)
            except Exception as error:  # drivers raise whatever they like, and a thread that dies says nothing
                self._ended = f"camera {self._info.name} gives no more frames ({' '.join(str(error).split())[:120]})"
                return
            self._number += 1
            piece = Piece(0, 0, np.ascontiguousarray(levels[::-1]))
            self._newest = CameraFrame(
                number=self._number, time=came - 0.5 * exposure, exposure=exposure, pieces=(piece,), sent=came
            )  # fmt: skip
