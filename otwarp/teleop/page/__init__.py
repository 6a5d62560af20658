"""The page: a session in a browser, drawn and asked by viser in a process of its own.

In come `LiveFrame`s, out come commands. `PageProcess` here is the sink, as its session sees it; its other end is
`child`, a fresh interpreter (viser's threads would otherwise share ours with the stepping). Frames go down its stdin,
what its users ask comes up its stdout. A frame is sent only when the child has shown the one before, by a thread of its
own: `publish` copies a few arrays and returns, whatever the child does. Open `child` first.

session's process
    compose           a scene → what is drawn of it: solids as triangles, balls, traps, a camera
    measure           how long a state takes to the page, with a browser without a window
both
    protocol          what the two processes say to each other, and how it passes through a pipe
    access            who may see and use the page, and the socket it listens on
child's process
    child             `Page`: one thread that does everything in the order in which it comes
    viser_internals   what reaches into viser, and why: the guard before every request, above all
    scene_view        what is seen in 3-D
    gizmos            handles that are dragged
    controls          buttons and sliders
    readout           texts and plots
    camera_panel      what a camera sees, where it feeds the session
    front             what is added in the browser: words without WebGL, help, names for those who hear the page
    screenshot        a picture of the scene as a window shows it
"""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import BinaryIO

from otwarp.errors import InputError
from otwarp.haptics.core.config import FACING_USER, check_orthogonal
from otwarp.haptics.core.fields import Matrix
from otwarp.scene import Scene
from otwarp.teleop import HANDS, Command, LiveFrame
from otwarp.teleop.page.access import address, choose_token
from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.protocol import (
    Asked,
    Complaint,
    Failed,
    PageFrame,
    PageOrder,
    Ready,
    Shown,
    Visitors,
    receive,
    send,
)
from otwarp.teleop.page.viser_internals import without_override

RATES = (1.0, 120.0)
START_WITHIN = 60.0
"""Seconds in which the child must listen; a cold disk and a busy machine take some."""
STOP_WITHIN = 3.0
"""Seconds in which it must have ended before it is killed: it holds nothing that could be lost."""
MOST_LINES = 64
"""Complaints that wait for a child that does not read; older ones are dropped."""


class PageProcess:
    """An `Sink` in a browser, from `start` to `close`; used by one thread.

    Args:
        scene: What is shown.
        host: Interface to listen on; others than loopback need a token.
        port: None for 8080 or the next free one, 0 for any free one; a port that was asked for and is taken is an
            error.
        token: Secret that opens the page; None makes one up where others than this machine's users could reach it.
        pointers: Hand → name of its pointer mailbox (see `otwarp.haptics.devices.mouse`), for hands with device
            `mouse`: the page moves them.
        axis_maps: Hand → its axis map, scene = A·device; `FACING_USER` where none is given.
        rate: Frames per second that the page wants.
        ended: Called with one line, once, when the page's process ends by itself; default writes it to stderr.

    Raises:
        InputError: A number, a hand, an axis map or a token that cannot be; viser is not installed.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        host: str = "127.0.0.1",
        port: int | None = None,
        token: str | None = None,
        pointers: Mapping[str, str] = {},
        axis_maps: Mapping[str, Matrix] = {},
        rate: float = 30.0,
        ended: Callable[[str], None] | None = None,
    ):
        if not RATES[0] <= rate <= RATES[1]:
            raise InputError(f"rate = {rate!r}: must be from {RATES[0]:g} to {RATES[1]:g}")
        for name, given in (("pointers", pointers), ("axis_maps", axis_maps)):
            for hand in given:
                if hand not in HANDS:
                    raise InputError(f"{name} has {hand!r}: must be one of {', '.join(HANDS)}")
        for matrix in axis_maps.values():
            check_orthogonal(matrix)
        choose_token(token, loopback=True)
        if importlib.util.find_spec("viser") is None:
            raise InputError("page: needs viser; install otwarp[teleop], or run without the page")
        maps = {hand: axis_maps.get(hand, FACING_USER) for hand in HANDS}
        self._order = PageOrder(
            drawing=compose(scene), host=host, port=port, token=token, pointers=dict(pointers), axis_maps=maps
        )
        self._interval = 1.0 / rate
        self._ended = ended or (lambda line: print(line, file=sys.stderr))
        self._process: subprocess.Popen[bytes] | None = None
        self._wake = threading.Condition()
        self._frame: PageFrame | None = None
        self._lines: deque[str] = deque(maxlen=MOST_LINES)
        self._credit, self._over, self._reported = True, False, False
        self._asked: deque[Command] = deque()
        self._visitors = 0
        self._sent, self._applied = 0.0, 0.0
        self._delay: float | None = None
        self._threads: list[threading.Thread] = []
        self._url = ""
        self.dropped = 0
        """Frames that were not sent because the page had not shown the one before."""

    @property
    def interval(self) -> float:
        """See `Sink`."""
        return self._interval

    @property
    def url(self) -> str:
        """What to open in a browser; empty before `start`."""
        return self._url

    @property
    def visitors(self) -> int:
        """How many browser windows look at it."""
        return self._visitors if self.alive else 0

    @property
    def ready(self) -> bool:
        """Whether the page has shown the frame before, so that another would be sent."""
        return self._credit

    @property
    def applied(self) -> float:
        """Time from `publish` to the word that the page's process has handed the frame to the browsers [s]."""
        return self._applied

    @property
    def delay(self) -> float | None:
        """Time from `publish` to the latest answer of a browser, see `child.BrowserLatency` [s]; None without one."""
        return self._delay

    @property
    def pid(self) -> int | None:
        """Number of the child, once started."""
        return self._process.pid if self._process else None

    @property
    def alive(self) -> bool:
        """Whether the child runs."""
        return self._process is not None and not self._over and self._process.poll() is None

    def start(self) -> str:
        """Start the child; returns the address to open when it listens.

        Raises:
            InputError: The host or port cannot be, or the child ended or said nothing; the line says why.
        """
        if self._process is not None or self._over:
            raise InputError("page: start may be called once, before close")
        paths = os.pathsep.join(path for path in sys.path if path)
        environment = without_override(os.environ | {"PYTHONPATH": paths})
        command = [sys.executable, "-c", "from otwarp.teleop.page.child import child; child()"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, bufsize=-1
        )
        first: list[object] = []
        try:
            send(self._pipe("stdin"), self._order)
            hello = threading.Thread(target=lambda: first.append(_first(self._pipe("stdout"))), daemon=True)
            hello.start()
            hello.join(START_WITHIN)
        except OSError as error:
            first.append(Failed(f"page: its process ended at once ({error})"))
        answer = first[0] if first else Failed(f"page: its process does not answer within {START_WITHIN:g} s")
        if not isinstance(answer, Ready):
            self.close()
            raise InputError(answer.line if isinstance(answer, Failed) else f"page: its process said {answer!r}")
        self._url = address(_name_of(self._order.host), answer.port, answer.token)
        for work in (self._write, self._read):
            thread = threading.Thread(target=work, daemon=True, name=f"page{work.__name__}")
            thread.start()
            self._threads.append(thread)
        return self._url

    def publish(self, live: LiveFrame) -> None:
        """See `Sink`; dropped unless the page has shown the frame before."""
        self._tell_end()
        if not self.alive:
            return
        with self._wake:
            if not self._credit:
                self.dropped += 1
                return
            self._credit = False
            self._sent = time.monotonic()
            self._frame = PageFrame.of(live, self._sent)
            self._wake.notify()

    def commands(self) -> Sequence[Command]:
        """See `Sink`."""
        self._tell_end()
        asked = []
        while self._asked:
            asked.append(self._asked.popleft())
        return asked

    def complain(self, line: str) -> None:
        """See `Sink`."""
        with self._wake:
            self._lines.append(line)
            self._wake.notify()

    def close(self) -> None:
        """See `Sink`."""
        with self._wake:
            if self._over:
                return
            self._over = True
            self._wake.notify()
        process = self._process
        if process is None:
            return
        for thread in self._threads[:1]:  # the writer closes stdin, which ends the child
            thread.join(STOP_WITHIN)
        if not self._threads:
            _close(process.stdin)
        try:
            process.wait(STOP_WITHIN)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        for thread in self._threads:
            thread.join(STOP_WITHIN)
        _close(process.stdin)
        _close(process.stdout)

    def __enter__(self) -> PageProcess:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write(self) -> None:
        """Thread: send what waits, until the end."""
        pipe = self._pipe("stdin")
        while True:
            with self._wake:
                while not (self._lines or self._frame or self._over):
                    self._wake.wait()
                lines, frame = list(self._lines), self._frame
                self._lines.clear()
                self._frame = None
                over = self._over
            try:
                if over:
                    pipe.close()
                    return
                for line in lines:
                    send(pipe, Complaint(line))
                if frame is not None:
                    send(pipe, frame)
            except (OSError, ValueError):  # the child has gone; the reader notices as well
                return

    def _read(self) -> None:
        """Thread: take what comes, until the end."""
        pipe = self._pipe("stdout")
        while True:
            try:
                message = receive(pipe)
            except (EOFError, OSError, ValueError):
                return
            if isinstance(message, Shown):
                self._applied = time.monotonic() - self._sent
                self._delay = message.delay
                self._credit = True
            elif isinstance(message, Asked):
                self._asked.append(message.command)
            elif isinstance(message, Visitors):
                self._visitors = message.count

    def _tell_end(self) -> None:
        """Say once that the child ended by itself; the session goes on."""
        if self._reported or self._over or self._process is None or self._process.poll() is None:
            return
        self._reported = True
        self._ended(f"page: its process ended with {self._process.returncode}; the session goes on without it")

    def _pipe(self, name: str) -> BinaryIO:
        pipe = getattr(self._process, name, None)
        if pipe is None:
            raise InputError("page: not started")
        return pipe


def _first(pipe: BinaryIO) -> object:
    try:
        return receive(pipe)
    except (EOFError, OSError, ValueError):
        return Failed("page: its process ended before it listened")


def _name_of(host: str) -> str:
    """A name under which others reach a page that listens everywhere."""
    return socket.gethostname() if host in ("0.0.0.0", "::") else host


def _close(pipe: object) -> None:
    try:
        if pipe is not None:
            pipe.close()  # type: ignore[attr-defined]
    except OSError:  # what it still held cannot be written any more
        return
