"""A Haply Inverse Service for tests: a websocket server in threads that speaks the simulation channel's JSON.

It answers each message with one state of all devices, as the documents of versions 3.1 to 3.5 say, and can be told to
be silent, to say something else, to lose a device, or to hang up.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import Server, ServerConnection, serve

PATIENCE = 60.0
"""Seconds after which a test that waits for the service fails instead of hanging; nothing is measured by it."""


def inverse3(device: str) -> dict[str, Any]:
    return {
        "device_id": device,
        "config": {"type": "inverse3", "handedness": "right", "gravity_compensation": {"enabled": True}},
        "state": {
            "cursor_position": {"x": 0.0, "y": -0.12, "z": 0.15},
            "cursor_velocity": {"x": 0.0, "y": 0.0, "z": 0.0},
            "mode": "idle",
        },
        "status": {"calibrated": False, "in_use": False, "power_supply": True, "ready": True, "started": True},
    }


class HaplyService:
    """The server; a context manager.

    Args:
        version: `3.5` has a `session_id` and calls a force `vector`; before, it is `values`.
        devices, grips: Ids of the Inverse3 and of the handles by radio.
    """

    def __init__(self, *, version: str = "3.5", devices: tuple[str, ...] = ("049D",), grips: tuple[str, ...] = ()):
        self.key = "vector" if version == "3.5" else "values"
        self.devices = {device: inverse3(device) for device in devices}
        self.grips = {grip: {"a": False, "b": False, "c": False} for grip in grips}
        self.wired: dict[str, bool] = {}
        self.forces: dict[str, list[tuple[float, float, float]]] = {device: [] for device in devices}
        self.greetings: list[dict[str, Any]] = []
        self.hello: str | None = None
        self.says: Callable[[], str | bytes] | None = None
        self.mute = False
        self.messages = 0
        self._changed = threading.Condition()
        self._connections: list[ServerConnection] = []
        self._server: Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def address(self) -> str:
        assert self._server is not None
        return f"ws://127.0.0.1:{self._server.socket.getsockname()[1]}"

    def __enter__(self) -> HaplyService:
        self._server = serve(self._talk, "127.0.0.1", 0, compression=None, close_timeout=0.5, ping_interval=None)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        assert self._server is not None and self._thread is not None
        self._server.shutdown()
        self.hang_up()
        self._thread.join()

    def move(self, device: str, x: float, y: float, z: float) -> None:
        self.devices[device]["state"]["cursor_position"] = {"x": x, "y": y, "z": z}

    def hang_up(self) -> None:
        for connection in self._connections[:]:
            connection.close()

    def turns(self, n: int = 2) -> None:
        """Wait for n messages more, the last of which were answered with what is so now."""
        with self._changed:
            until = self.messages + n
            assert self._changed.wait_for(lambda: self.messages >= until, PATIENCE), "no message came"

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait until something is so that a message brings about."""
        with self._changed:
            assert self._changed.wait_for(condition, PATIENCE), "it did not come about"

    def _frame(self, *, full: bool) -> str:
        frame: dict[str, Any] = {"session_id": 7} if self.key == "vector" else {}
        hide = () if full else ("config",)
        frame["inverse3"] = [{k: v for k, v in d.items() if k not in hide} for d in self.devices.values()]
        frame["wireless_verse_grip"] = [
            {"device_id": grip, "state": {"buttons": buttons, "battery_level": 0.9}, "status": {"awake": True}}
            for grip, buttons in self.grips.items()
        ]
        frame["verse_grip"] = [{"device_id": g, "state": {"button": b, "hall": 0}} for g, b in self.wired.items()]
        return json.dumps(frame)

    def _talk(self, connection: ServerConnection) -> None:
        self._connections.append(connection)
        try:
            connection.send(self.hello if self.hello is not None else self._frame(full=True))
            for message in connection:
                self._take(json.loads(message))
                if not self.mute:
                    connection.send(self.says() if self.says else self._frame(full=False))
                with self._changed:
                    self.messages += 1
                    self._changed.notify_all()
        except ConnectionClosed:
            pass  # the client left without waiting for its answer
        finally:
            self._connections.remove(connection)

    def _take(self, message: dict[str, Any]) -> None:
        if "session" in message:
            self.greetings.append(message["session"])
        for command in message["inverse3"]:
            vector = command["commands"]["set_cursor_force"].get(self.key)
            if vector is not None and command["device_id"] in self.forces:
                self.forces[command["device_id"]].append((vector["x"], vector["y"], vector["z"]))
