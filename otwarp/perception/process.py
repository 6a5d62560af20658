"""`ProcessLooker`: camera and estimator in a process of their own, so that no image holds up the session's loop."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from otwarp.errors import InputError
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.perception.assemble import Seeing, SeeingOptions, estimator_of, see
from otwarp.perception.camera import Camera, CameraInfo, CameraLost
from otwarp.perception.estimator import Estimator, Look, Wanted
from otwarp.perception.kinds import make_camera
from otwarp.perception.lab import LabCamera, LabOrder, child_process, end_process, protected_stdout
from otwarp.perception.link import CommandWriter, packed, unpacked, wanted_layout
from otwarp.scene import Scene
from otwarp.teleop.page.protocol import receive, send
from otwarp.vision.view import camera_of, image_size

LOOK_AROUND = 3e-4
"""Seconds between two looks at the camera."""

FOLLOW_EVERY, KEPT = 4e-3, 600
"""Seconds between two looks at what is wanted, and how many of these are kept: 5 s of a loop with 120 turns."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LookerOrder:
    """All that the process must know.

    Attributes:
        scene: Of the twin, with its camera.
        seeing: What is looked for, and by what.
        wanted: Name of the box of what is wanted; bodies: how many it has room for.
        camera: As the user named it.
        lab: The laboratory, if it is simulated.
    """

    scene: Scene
    seeing: SeeingOptions
    wanted: str
    bodies: int
    camera: str
    lab: LabOrder | None


@dataclass(frozen=True, eq=False)
class Ready:
    """The camera runs.

    Attributes:
        info: Of the camera.
        pieces, about: Of what looks, see `assemble.Seeing`.
    """

    info: CameraInfo
    pieces: dict[int, int]
    about: dict[str, str]


class ProcessLooker:
    """A `Looker` beside the session.

    Args:
        scene: Of the twin, with its camera.
        seeing: What is looked for.
        bodies: How many bodies that is.
        camera: As the user named it.
        lab: Makes the order of a simulated laboratory from the name of its box of commands; None for other cameras.
        say: Takes lines for the user while it begins.

    Attributes:
        pieces, about: See `assemble.Seeing`; after `open`.
    """

    def __init__(
        self,
        scene: Scene,
        seeing: SeeingOptions,
        *,
        bodies: int,
        camera: str,
        lab: Callable[[str], LabOrder] | None = None,
        say: Callable[[str], None] = lambda _: None,
    ):
        self._wanted: Mailbox[Any] = Mailbox.create(wanted_layout(bodies))
        self._commands = CommandWriter(len(scene.traps)) if lab is not None else None
        box = self._commands.box.name if self._commands is not None else ""
        self._order = LookerOrder(
            scene=scene, seeing=seeing, wanted=self._wanted.name, bodies=bodies, camera=camera,
            lab=lab(box) if lab is not None else None,
        )  # fmt: skip
        self._say = say
        self._info = CameraInfo(name=camera, kind="", simulated=lab is not None)
        self._process: subprocess.Popen[bytes] | None = None
        self._looks: deque[Look] = deque()
        self._come = threading.Event()
        self._ended, self._over = "", False
        self.pieces: dict[int, int] = {}
        self.about: dict[str, str] = {}

    @property
    def info(self) -> CameraInfo:
        """See `Looker`."""
        return self._info

    def open(self) -> None:
        """Start the process, and wait until its camera runs and everything that looks is there.

        Raises:
            InputError: The camera or a network is not there, or cannot be used; nothing runs then.
        """
        self._process = child_process("otwarp.perception.process")
        try:
            send(self._pipe("stdin"), self._order)
            while not self.pieces:
                word = receive(self._pipe("stdout"))
                if isinstance(word, Ready):
                    self._info, self.pieces, self.about = word.info, word.pieces, word.about
                elif isinstance(word, Exception):
                    raise word
                else:
                    self._say(str(word))
        except (EOFError, OSError, ValueError) as error:
            if isinstance(error, InputError):
                self.close()
                raise
            code = self._process.wait()
            self.close()
            raise InputError(f"camera {self._order.camera}: the process that reads it ended with {code}") from None
        except BaseException:
            self.close()
            raise
        threading.Thread(target=self._receive, daemon=True, name="perception").start()

    def start(self, now: float) -> None:
        """See `Looker`."""
        if not self.pieces:
            self.open()

    def command(self, now: float, position: np.ndarray, power: np.ndarray) -> None:
        """See `Looker`."""
        if self._commands is not None:
            self._commands.write(now, position, power)

    def want(self, wanted: Sequence[Wanted]) -> None:
        """See `Looker`."""
        self._wanted.write(packed(time.perf_counter(), wanted))

    def looks(self, now: float) -> list[Look]:
        """See `Looker`."""
        self._come.clear()
        found = []
        while self._looks:
            found.append(self._looks.popleft())
        if not found and self._ended and not self._over:
            raise CameraLost(self._ended)
        return found

    def await_look(self, until: float) -> bool:
        """See `Looker`."""
        return not self._ended and self._come.wait(max(until - time.perf_counter(), 0.0))

    def restart(self) -> None:
        """See `Looker`."""
        if self._commands is not None:
            self._commands.restart()

    def close(self) -> None:
        """See `Looker`."""
        self._over = True
        process, self._process = self._process, None
        end_process(process)
        self._wanted.close()
        if self._commands is not None:
            self._commands.box.close()

    def _receive(self) -> None:
        """Thread: looks as they come."""
        pipe = self._pipe("stdout")
        try:
            while True:
                word = receive(pipe)
                if isinstance(word, Look):
                    self._looks.append(word)
                else:
                    self._ended = str(word)
                self._come.set()
        except (EOFError, OSError, ValueError):
            self._ended = self._ended or f"camera {self._order.camera}: the process that reads it has ended"
            self._come.set()

    def _pipe(self, name: str) -> BinaryIO:
        pipe = getattr(self._process, name, None)
        if pipe is None:
            raise InputError("perception: is not open")
        return pipe


def child() -> None:
    """What the process does, until its stdin ends."""
    source, sink = sys.stdin.buffer, protected_stdout()
    order: LookerOrder = receive(source)
    ended = threading.Event()
    threading.Thread(target=lambda: (source.read(1), ended.set()), daemon=True).start()
    camera: Camera | None = None
    try:
        box = Mailbox.attach(wanted_layout(order.bodies), order.wanted)
        seeing: Seeing = see(order.scene, order.seeing, lambda line: send(sink, line))
        camera = LabCamera(order.lab) if order.lab is not None else make_camera(order.camera)
        camera.open()
        size = None if order.lab is not None else image_size(camera_of(order.scene))
        if size is not None and camera.info.size not in (None, size):
            raise InputError(wrong_size(order, camera.info.size, size))
        estimator = estimator_of(order.scene, seeing)
        estimator.warm_up()
        send(sink, Ready(camera.info, dict(seeing.pieces), dict(seeing.about)))
        _serve(order, camera, estimator, box, ended, sink)
    except InputError as error:
        _tell(sink, error)
    except (BrokenPipeError, KeyboardInterrupt):
        pass
    except Exception as error:  # a defect of ours: the session says one line, the rest is for whoever mends it
        traceback.print_exc()
        _tell(sink, InputError(f"camera {order.camera}: the process that reads it failed ({error!r})"))
    finally:
        if camera is not None:
            camera.close()
    os._exit(0)


class Expected:
    """Where bodies were expected in the last seconds: a frame that is late is looked at with what was expected then.

    Args:
        box: Of what is wanted.
    """

    def __init__(self, box: Mailbox[Any]):
        self._box = box
        self._past: deque[tuple[float, tuple[Wanted, ...]]] = deque(maxlen=KEPT)

    def follow(self, ended: threading.Event) -> None:
        """Thread: keep what the session says, until the end."""
        while not ended.wait(FOLLOW_EVERY):
            told = self._box.read()
            if told is not None:
                self._past.append(unpacked(told))

    def at(self, when: float) -> tuple[Wanted, ...]:
        """What was wanted at a time [s], or first; nothing before anything was."""
        past = list(self._past)
        before = [wanted for time, wanted in past if time <= when]
        return before[-1] if before else past[0][1] if past else ()


def wrong_size(order: LookerOrder, found: tuple[int, int] | None, size: tuple[int, int]) -> str:
    """Of a real camera whose frames are not those of the scene's: places would count from another middle.

    Args:
        order: Of the process.
        found: Pixels of its frames (width, height).
        size: Those of the scene's camera.
    """
    (wide, high), camera = found or (0, 0), camera_of(order.scene)
    here = " × ".join(f"{side:.4g}" for side in camera.frame)
    return (f"camera {order.camera}: frames are {wide} × {high} pixels; allowed: {size[0]} × {size[1]}, as "
            f"{camera.prim} has them, {here} µm in pixels of {camera.pixel_size:.4g} µm")  # fmt: skip


def _serve(
    order: LookerOrder,
    camera: Camera,
    estimator: Estimator,
    box: Mailbox[Any],
    ended: threading.Event,
    sink: BinaryIO,
) -> None:
    """Look at the latest frame, again and again."""
    size = image_size(camera_of(order.scene))
    wanted = Expected(box)
    threading.Thread(target=wanted.follow, args=(ended,), daemon=True, name="wanted").start()
    while not ended.is_set():
        latest = wanted.at(math.inf)
        if latest:
            camera.aim([w.region for w in latest])
        try:
            frame = camera.read(time.perf_counter()) if latest else None
            if frame is not None and order.lab is None:
                high, wide = frame.pieces[0].levels.shape
                if (wide, high) != size:
                    raise CameraLost(wrong_size(order, (wide, high), size))
        except CameraLost as error:
            send(sink, str(error))
            return
        if frame is None:
            time.sleep(LOOK_AROUND)
        else:
            send(sink, estimator.look(frame, wanted.at(frame.time), time.perf_counter()))


def _tell(sink: BinaryIO, word: object) -> None:
    with suppress(OSError, ValueError):  # nobody may be there to hear it
        send(sink, word)
