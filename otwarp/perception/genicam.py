"""`GenicamCamera`: a camera that speaks GenICam, through `harvesters` and the producer file of its maker.

Its stamps are ticks of its own clock. How far that is from ours is the least difference to the arrival of a frame in
the last seconds, so that clocks may drift apart, and one that is set anew is believed again. The binding was tested
against a double; it never met a camera.
"""

from __future__ import annotations

import re
import threading
import time
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.perception.camera import CameraFrame, CameraInfo, CameraLost, Piece, Region
from otwarp.perception.files import grey

FETCH_WITHIN = 1.0
"""Seconds for which a frame is waited for at a time."""

CLOCK_OVER = 5.0
"""Seconds of frames of which the quickest tells what the camera's clock shows."""

SILENT = 5.0
"""Seconds without a frame after which the camera counts as gone."""


class GenicamCamera:
    """A GenICam camera; a thread waits for its frames.

    Args:
        where: Its serial number, or its place in the list (0 for the first).
        name: As the user named it.
        cti: Producer file of the camera's maker.
        rate: Frames per second that it is asked for; None: its own.
        exposure: Exposure time that it is asked for [s]; None: its own.

    Raises:
        InputError: No producer file.
    """

    def __init__(
        self, where: str, *, name: str = "", cti: str = "", rate: float | None = None, exposure: float | None = None
    ):
        if not cti:
            raise InputError(f"--camera {name or where} names no producer; allowed: genicam:WHERE,cti=FILE.cti")
        self._where, self._cti, self._rate, self._exposure = where, cti, rate, exposure
        self._info = CameraInfo(name=name or where, kind="genicam", stand_in="a double of harvesters")
        self._harvester: Any = None
        self._acquirer: Any = None
        self._newest: CameraFrame | None = None
        self._number, self._over, self._ended = 0, False, ""
        self._offsets: deque[tuple[float, float]] = deque()
        self._thread: threading.Thread | None = None

    @property
    def info(self) -> CameraInfo:
        """See `Camera`."""
        return self._info

    def open(self) -> None:
        """See `Camera`."""
        try:
            from harvesters.core import Harvester  # type: ignore[import-not-found]
        except ImportError:
            raise InputError(
                f"--camera {self._info.name} needs harvesters; install it, and your camera's producer"
            ) from None
        self._harvester = Harvester()
        try:
            self._harvester.add_file(self._cti)
            self._harvester.update()
            which: Any = (
                int(self._where) if len(self._where) < 4 and self._where.isdigit() else {"serial_number": self._where}
            )
            self._acquirer = self._harvester.create(which)
            nodes = self._acquirer.remote_device.node_map
            if self._rate is not None:
                nodes.AcquisitionFrameRate.value = self._rate
            if self._exposure is not None:
                nodes.ExposureTime.value = 1e6 * self._exposure  # µs by the standard naming convention
            self._acquirer.start()
        except Exception as error:  # producers raise whatever they like
            self.close()
            why = str(error).splitlines()[0] if str(error) else repr(error)
            raise InputError(
                f"--camera {self._info.name}: cannot be opened ({why}); allowed: a camera that is there"
            ) from None
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
            self._thread.join(2.0 * FETCH_WITHIN)
        for part, end in ((self._acquirer, "destroy"), (self._harvester, "reset")):
            if part is not None:
                getattr(part, end)()
        self._acquirer = self._harvester = None

    def _offset(self, came: float, offset: float) -> float:
        """What our clock shows more than the camera's [s]: by the quickest frame of the last seconds."""
        while self._offsets and self._offsets[-1][1] >= offset:
            self._offsets.pop()
        self._offsets.append((came, offset))
        while self._offsets[0][0] < came - CLOCK_OVER:
            self._offsets.popleft()
        return self._offsets[0][1]

    def _wait(self) -> None:
        """Thread: frames as they come."""
        exposure, last = self._exposure or 0.0, time.perf_counter()
        while not self._over:
            try:
                with self._acquirer.fetch(timeout=FETCH_WITHIN) as buffer:
                    came = time.perf_counter()
                    last = came
                    component = buffer.payload.components[0]
                    data = np.array(component.data).reshape(component.height, component.width)
                    levels = grey(data, self._info.name, bits_of(component.data_format))
                    stamp = 1e-9 * float(buffer.timestamp_ns) if buffer.timestamp_ns else came
            except InputError as error:
                self._ended = str(error)
                return
            except Exception as error:  # a timeout, or a camera that is gone
                if time.perf_counter() - last > SILENT:
                    self._ended = f"camera {self._info.name} gives no more frames ({type(error).__name__})"
                    return
                continue
            self._number += 1
            piece = Piece(0, 0, np.ascontiguousarray(levels[::-1]))
            when = stamp + self._offset(came, came - stamp) - 0.5 * exposure
            self._newest = CameraFrame(
                number=self._number, time=when, exposure=exposure, pieces=(piece,), sent=came
            )  # fmt: skip


def bits_of(data_format: str) -> int:
    """Bits of a grey level by the name of a pixel format of GenICam, as `Mono12` or `Mono10p`; 16 where it has none.

    Args:
        data_format: As the Pixel Format Naming Convention has it.
    """
    found = re.match(r"[A-Za-z]*?(\d+)", data_format)
    return min(max(int(found[1]), 8), 16) if found else 16
