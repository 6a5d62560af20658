"""`LabCamera`: a simulated laboratory in a process of its own, and its microscope as a camera.

The plant goes on from command to command, whatever rendering takes; a frame is rendered when somebody waits for it,
from the latest exposure, only around the bodies that are looked for. So frames come at the rate that the machine
carries.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO, cast

from otwarp.errors import InputError
from otwarp.perception.camera import CameraFrame, CameraInfo, CameraLost, Region
from otwarp.perception.link import CommandReader
from otwarp.perception.photographer import Photographer
from otwarp.perception.plant import Plant
from otwarp.perception.simulated import SimulatedCamera
from otwarp.scene import Scene
from otwarp.teleop.page.protocol import receive, send
from otwarp.vision.rendering import Rendering

START_WITHIN = 120.0
"""Seconds in which the laboratory must run; the first time kernels are compiled."""

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables that bound the threads of libraries, where the user has not set them."""

LOOK_AROUND = 5e-4
"""Seconds between two looks at the commands."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LabOrder:
    """All that a simulated laboratory must know.

    Attributes:
        scene: As the laboratory has it.
        commands: Name of the box of commands.
        seed, device: Of its simulation.
        rate: Exposures per second.
        rendering: How images are computed.
        name: Of the camera, as the user named it.
    """

    scene: Scene
    commands: str
    seed: int
    device: str | None
    rate: float
    rendering: Rendering
    name: str


class LabCamera:
    """The process, as who reads its camera holds it.

    Args:
        order: What it is to be.
    """

    def __init__(self, order: LabOrder):
        self._order = order
        self._info = CameraInfo(name=order.name, kind="simulated", simulated=True)
        self._process: subprocess.Popen[bytes] | None = None
        self._regions: tuple[Region, ...] = ()
        self._asked = self._over = False
        self._frames: deque[CameraFrame] = deque()
        self._ended = ""

    @property
    def info(self) -> CameraInfo:
        """See `Camera`."""
        return self._info

    def open(self) -> None:
        """See `Camera`."""
        self._process = child_process("otwarp.perception.lab")
        send(self._pipe("stdin"), self._order)
        answer = first_word(self._process, START_WITHIN, f"camera {self._order.name}: its laboratory")
        if isinstance(answer, str):
            self.close()
            raise InputError(answer)
        threading.Thread(target=self._receive, daemon=True, name="lab").start()

    def aim(self, regions: Sequence[Region]) -> None:
        """See `Camera`."""
        self._regions = tuple(regions)

    def read(self, now: float) -> CameraFrame | None:
        """See `Camera`."""
        if self._ended and not self._over:
            raise CameraLost(self._ended)
        if self._frames:
            self._asked = False
            return self._frames.popleft()
        # asked for when somebody is there to look at it: one that was rendered ahead would be old by then
        if not self._asked and self._regions:
            self._asked = True
            try:
                send(self._pipe("stdin"), self._regions)
            except (OSError, ValueError):
                raise CameraLost(f"camera {self._order.name}: its laboratory has ended") from None
        return None

    def close(self) -> None:
        """See `Camera`."""
        self._over = True
        end_process(self._process)
        self._process = None

    def _receive(self) -> None:
        """Thread: frames as they come."""
        pipe = self._pipe("stdout")
        try:
            while True:
                message = receive(pipe)
                if isinstance(message, str):
                    self._ended = message
                    return
                self._frames.append(message)
        except (EOFError, OSError, ValueError):
            self._ended = self._ended or f"camera {self._order.name}: its laboratory has ended"

    def _pipe(self, name: str) -> BinaryIO:
        pipe = getattr(self._process, name, None)
        if pipe is None:
            raise CameraLost(f"camera {self._order.name}: is not open")
        return pipe


def child() -> None:
    """What the laboratory's process does, until its stdin ends."""
    source, sink = sys.stdin.buffer, protected_stdout()
    order: LabOrder = receive(source)
    asked: list[tuple[Region, ...]] = []
    ended = threading.Event()
    threading.Thread(target=_listen, args=(source, asked, ended), daemon=True).start()
    try:
        reader = CommandReader(order.commands, len(order.scene.traps))
        microscope = Photographer(order.scene, rendering=order.rendering, device=order.device, seed=order.seed)
        plant = Plant(order.scene, seed=order.seed, device=order.device)
        _warm(plant, microscope)
        send(sink, True)
    except Exception as error:  # one line, whatever it is: the session must know
        send(sink, f"camera {order.name}: {one_line(error)}")
        return
    try:
        _serve(order, reader, plant, microscope, asked, ended, sink)
    except (OSError, ValueError):  # nobody reads any more
        pass
    except Exception as error:
        send(sink, f"camera {order.name}: its laboratory stopped ({one_line(error)})")
    os._exit(0)


def _warm(plant: Plant, microscope: Photographer) -> None:
    """Compile what steps and what renders, before anybody waits for it."""
    other = plant.anew()
    other.advance(plant.sim.time_step)
    place, turn = other.poses()
    column, row = (n // 2 for n in microscope.size)
    microscope.pieces(place[None], turn[None], [Region(column - 16, row - 16, 32, 32)], 0)


def _serve(
    order: LabOrder,
    reader: CommandReader,
    plant: Plant,
    microscope: Photographer,
    asked: list[tuple[Region, ...]],
    ended: threading.Event,
    sink: BinaryIO,
) -> None:
    """Follow commands, and render whenever somebody asks."""
    exposure = order.scene.camera.exposure if order.scene.camera is not None else 0.0
    camera = SimulatedCamera(plant, microscope, rate=order.rate, exposure=exposure, name=order.name)
    restarts = 0
    while not ended.is_set():
        commands = reader.read()
        if reader.restarts != restarts:
            restarts = reader.restarts
            camera.restart()
        for command in commands:
            camera.command(*command)
        if asked:
            camera.aim(asked[-1])
            frame = camera.read(time.perf_counter())
            if frame is not None:
                asked.clear()
                send(sink, frame)
                continue
        time.sleep(LOOK_AROUND)


def _listen(source: BinaryIO, asked: list[Any], ended: threading.Event) -> None:
    """Thread: regions that are asked for, until the end."""
    try:
        while True:
            asked.append(receive(source))
    except (EOFError, OSError, ValueError):
        ended.set()


def one_line(error: BaseException) -> str:
    """What an error says, or its kind where it says nothing."""
    return " ".join(str(error).split()) or repr(error)


def child_process(module: str) -> subprocess.Popen[bytes]:
    """A fresh interpreter that runs `child` of a module, with pipes to it."""
    paths = os.pathsep.join(path for path in sys.path if path)
    command = [sys.executable, "-c", f"from {module} import child; child()"]
    # small matrices and several processes: threads of a library would wait for each other longer than they work
    environment = {name: "1" for name in ONE_THREAD} | os.environ | {"PYTHONPATH": paths}
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)


def protected_stdout() -> BinaryIO:
    """The pipe to the parent; what anybody prints goes to standard error instead."""
    pipe = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return pipe


def first_word(process: subprocess.Popen[bytes], within: float, who: str) -> Any:
    """The first message of a child; a line of text where there is none."""
    answer: list[Any] = []

    def listen() -> None:
        """Wait for the message, or for the child's end."""
        try:
            answer.append(receive(cast(BinaryIO, process.stdout)))
        except (EOFError, OSError, ValueError):
            answer.append(f"{who} ended at once, with {process.wait()}")

    thread = threading.Thread(target=listen, daemon=True)
    thread.start()
    thread.join(within)
    return answer[0] if answer else f"{who} does not answer within {within:g} s"


def end_process(process: subprocess.Popen[bytes] | None, within: float = 3.0) -> None:
    """Close a child's stdin, which ends it; kill it if it does not."""
    if process is None:
        return
    try:
        if process.stdin is not None:
            process.stdin.close()
    except OSError:
        pass
    try:
        process.wait(within)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
