"""The page's process: viser, and one thread that does everything in the order in which it comes.

Frames of the session, drags and clicks are put into one queue; nobody else touches the scene, so nothing needs a lock.
It ends when its stdin ends: by order, or because its session is gone.
"""

from __future__ import annotations

import logging
import math
import os
import queue
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, BinaryIO

from otwarp.errors import InputError
from otwarp.haptics.core import Vec3
from otwarp.haptics.core.realtime import ordinary
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.devices.mouse import POINTER
from otwarp.teleop import Command
from otwarp.teleop.page.access import access_for, listen
from otwarp.teleop.page.camera_panel import CameraPanel
from otwarp.teleop.page.controls import Controls, gizmo_position
from otwarp.teleop.page.front import head
from otwarp.teleop.page.gizmos import Gizmos, Pointer
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
from otwarp.teleop.page.readout import News, Plots
from otwarp.teleop.page.scene_view import BACKGROUND, SceneView
from otwarp.teleop.page.screenshot import send_screenshot
from otwarp.teleop.page.viser_internals import guarded_server

if TYPE_CHECKING:
    import viser

TICK = 0.05
"""Seconds after which the loop looks around though nothing came: pointers must be written."""
TRAP_HANDLE, HAND_HANDLE = 0.045, 0.075
"""Size of handles over the distance of the camera."""
WIDE = (-1e6, 1e6)
"""Limits of a handle along an axis [µm]: none that matters."""
NOTICE = 8.0
"""Seconds for which a notification stays."""
RATE_OVER = 2.0
"""Seconds over which the page's frame rate is counted."""
MOST_FAILURES = 5
"""Failures of a picture that are written to stderr."""
ECHO_EVERY, ECHO_WITHIN = 1.0, 2.0
"""Seconds between two questions to a browser, and for which one waits for its answer: a hidden window sleeps."""
ECHO_KEY = "otwarp-echo"
"""Of the browser's local storage; nothing is kept there."""


class BrowserLatency:
    """How old the state is that a browser shows: from the session's `publish` to an answer of the browser that has it.

    Asks one browser after the other, in a thread of its own. A browser answers a request that it takes from the same
    connection, after the messages of the frame. The way back is in the figure, and the drawing after it is not: an
    upper bound of the arrival, not of the light on the screen.

    Attributes:
        delay: The latest answer [s], None without one.
    """

    def __init__(self, server: viser.ViserServer, clock: Callable[[], float]):
        self._server, self._clock = server, clock
        self._stamp: float | None = None
        self._asked = threading.Event()
        self._turn = 0
        self.delay: float | None = None
        threading.Thread(target=self._run, daemon=True, name="page-latency").start()

    def shown(self, stamp: float) -> None:
        """A frame of this time was handed to the connections just now; asks if it is time to."""
        if not self._asked.is_set():
            self._stamp = stamp
            self._asked.set()

    def _run(self) -> None:
        while True:
            self._asked.wait()
            self._measure()
            time.sleep(ECHO_EVERY)
            self._asked.clear()

    def _measure(self) -> None:
        clients, stamp = list(self._server.get_clients().values()), self._stamp
        if not clients or stamp is None:
            self.delay = None
            return
        self._turn += 1
        try:
            clients[self._turn % len(clients)].local_storage.get_item(ECHO_KEY, timeout=ECHO_WITHIN)
            self.delay = self._clock() - stamp
        except (RuntimeError, TimeoutError):
            self.delay = None


class Page:
    """Everything of one page.

    Args:
        server: viser's, with access guarded.
        order: What the session wants.
        tell: Sends a message to the session.
    """

    def __init__(self, server: viser.ViserServer, order: PageOrder, tell: Callable[[object], None]):
        self._server, self._tell = server, tell
        self._inbox: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._clients: set[int] = set()
        self._failures = 0
        self._shown: deque[float] = deque()
        self._news = News()
        drawing = order.drawing
        boxes = {hand: Mailbox.attach(POINTER, name) for hand, name in order.pointers.items()}
        self._pointers = {hand: Pointer(box.write, order.axis_maps[hand]) for hand, box in boxes.items()}
        gui = server.gui
        gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False, brand_color=(40, 150, 200))
        gui.set_panel_label(f"otwarp · {drawing.title}")
        self._view = SceneView(server, drawing)
        self._size = math.dist(drawing.camera.position, drawing.camera.look_at)
        self._gizmos = Gizmos(drawing.traps, self._pointers, self._handle)
        self._controls = Controls(
            server,
            drawing,
            self._view,
            self._gizmos,
            post=self._inbox.put,
            ask=self._ask,
            tell=self._notify,
            clock=time.monotonic,
            screenshot=lambda client: send_screenshot(client, BACKGROUND[0]),
        )
        gui.main_panel.dock_right()
        side = gui.add_panel()
        side.dock_left()
        side.set_width(310)
        self._plots = Plots(gui, side.add_tab("Last 20 s"), drawing)
        self._camera = CameraPanel(server)
        self._latency = BrowserLatency(server, time.monotonic)
        server.on_client_connect(self._connected)
        server.on_client_disconnect(self._disconnected)

    def run(self, pipe: BinaryIO) -> None:
        """Serve until the pipe ends."""
        threading.Thread(target=self._listen, args=(pipe,), daemon=True, name="page-frames").start()
        while True:
            try:
                work = self._inbox.get(timeout=TICK)
            except queue.Empty:
                work = _nothing
            if work is None:
                return
            try:
                work()
            except Exception:  # a picture that fails must not end the page, whose user may want to press `Disarm all`
                self._failures += 1
                if self._failures <= MOST_FAILURES:
                    traceback.print_exc()
            now = time.monotonic()
            for pointer in self._pointers.values():
                pointer.tick(now, bool(self._clients))

    def _listen(self, pipe: BinaryIO) -> None:
        """Thread: what the session says becomes work."""
        while True:
            try:
                message = receive(pipe)
            except (EOFError, OSError, ValueError):
                self._inbox.put(None)
                return
            if isinstance(message, PageFrame):
                self._inbox.put(lambda frame=message: self._take(frame))
            elif isinstance(message, Complaint):
                self._inbox.put(lambda line=message.line: self._notify(line))

    def _take(self, frame: PageFrame) -> None:
        """Put a frame on all screens, then ask for the next."""
        try:
            self._show(frame)
        finally:
            self._tell(Shown(frame.beat, self._latency.delay))

    def _show(self, frame: PageFrame) -> None:
        now = time.monotonic()
        self._shown.append(now)
        while self._shown and now - self._shown[0] > RATE_OVER:
            self._shown.popleft()
        with self._server.atomic():
            self._view.update(frame, now)
            self._gizmos.update(frame, now)
        self._server.flush()
        self._latency.shown(frame.stamp)
        self._plots.update(frame, now)
        self._camera.update(frame.perceived, now)
        rate = len(self._shown) / RATE_OVER
        self._controls.update(frame, now, rate, self._latency.delay, len(self._clients))
        for line in self._news.of(frame.warnings, now):
            self._notify(line, "Warning", "red")

    def _ask(self, command: Command) -> None:
        self._tell(Asked(command))

    def _notify(self, line: str, title: str = "otwarp", colour: Any = "orange") -> None:
        for client in self._server.get_clients().values():
            client.add_notification(title, line, auto_close_seconds=NOTICE, color=colour)

    def _handle(self, name: str, position: Vec3, whole: bool) -> Any:
        """A transform control whose drags become work."""
        handle = self._server.scene.add_transform_controls(
            f"/handles/{name}",
            scale=(HAND_HANDLE if whole else TRAP_HANDLE) * self._size,
            line_width=3.0 if whole else 2.0,
            disable_rotations=True,
            disable_sliders=not whole,
            depth_test=False,
            opacity=0.95 if whole else 0.8,
            position=position,
            translation_limits=(WIDE, WIDE, WIDE),
        )

        async def dragged(event: Any) -> None:
            place, client, phase = gizmo_position(event), int(event.client_id or 0), event.phase
            self._inbox.put(lambda: self._dragged(name, client, phase, place))

        handle.on_update(dragged)
        return handle

    def _dragged(self, name: str, client: int, phase: str, place: Vec3) -> None:
        for command in self._gizmos.drag(name, client, phase, place, time.monotonic()):
            self._ask(command)

    async def _connected(self, client: Any) -> None:
        self._inbox.put(lambda: self._visit(client.client_id, True))

    async def _disconnected(self, client: Any) -> None:
        self._inbox.put(lambda: self._visit(client.client_id, False))

    def _visit(self, client: int, here: bool) -> None:
        if here:
            self._clients.add(client)
        else:
            self._clients.discard(client)
            self._gizmos.release(client, time.monotonic())
        self._tell(Visitors(len(self._clients)))


def _nothing() -> None:
    """What there is to do when nothing came."""


def child() -> None:
    """What the child does: take its order from stdin, listen, serve, end."""
    ordinary()
    # a browser that opens a connection and thinks better of it is no news for the terminal
    logging.getLogger("websockets").setLevel(logging.CRITICAL)
    pipe, out = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)  # viser prints its own address, which is not the one to open
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to the parent, which closes the page in order
    lock = threading.Lock()

    def tell(message: object) -> None:
        """Send to the session; one that has gone is noticed by the end of stdin."""
        try:
            with lock:
                send(out, message)
        except (OSError, ValueError):
            return

    try:
        order: PageOrder = receive(pipe)
    except EOFError:
        return  # the parent died before it had said anything
    try:
        listening = listen(order.host, order.port)
        access = access_for(listening, order.token)
        title = f"otwarp · {order.drawing.title}"
        server = guarded_server(listening, access, title, head(title))
        page = Page(server, order, tell)
    except InputError as error:
        tell(Failed(str(error)))
        os._exit(2)
    except Exception:
        traceback.print_exc()
        os._exit(1)
    tell(Ready(access.port, access.token))
    page.run(pipe)
    os._exit(0)  # viser's threads may wait for browsers that are gone
