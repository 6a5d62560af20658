"""Haply Inverse3 by the Haply Inverse Service: `haply`, `inverse3:049D`, `inverse3:ws://host:10001/049D,grip=61548`.

A thread of ours talks to the service by websocket. Each force that the servo writes wakes it; it sends the force and
takes the state that the service answers with, so messages keep the rate of the servo. An `Exchange` joins the two. What
is said is in `inverse3_messages`.

Never met hardware: tests run it against a server of their own that speaks the same JSON.
"""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, DeviceInfo, DeviceLost, DeviceSample, Vec3
from otwarp.haptics.devices import DeviceSpec, parse_parameters
from otwarp.haptics.devices.exchange import Exchange
from otwarp.haptics.devices.inverse3_messages import (
    BadMessage,
    Inventory,
    force_command,
    greeting,
    read_inventory,
    read_state,
)

SERVICE = "ws://localhost:10001"
FORCE, CONTINUOUS_FORCE = 4.0, 1.5
"""Largest and continuous force [N]. Ours, not the device's: the service does not say them and no data sheet was at
hand; public drivers command it up to 10 N."""
CONNECT_WITHIN = 2.0
"""Seconds for the service to take a connection and send its inventory; it is a process of the same machine."""
PACE = 0.01
"""Seconds without a write of the servo after which a message goes out all the same: forces must fade, and the service
answers only who speaks."""
ANSWER_WITHIN = 0.02
"""Seconds to wait for an answer before the next message goes out: the service may still render the last force."""
ABSENCES = 10
"""States in a row without the device after which it is unplugged."""
CLOSE_WITHIN = 0.5
"""Seconds for the closing handshake."""
MOST_ANSWERS = 64
"""Messages taken at a time: a service that does not stop talking must not keep a fading force from being sent."""
LARGEST = 2**20
"""Bytes of a message; an inventory of a device has 1.5 thousand."""


class Inverse3Device:
    """An Inverse3 of a running service.

    Args:
        service: Address of its simulation channel.
        device: Id of the Inverse3, or None for the first that no other side of this process has.
        grip: Id of the handle whose buttons count, or None for the one with the same place among the handles as the
            Inverse3 has among its kind.
        name: As the user named it.
        clock: Of the force's age [s].
    """

    def __init__(
        self,
        service: str = SERVICE,
        device: str | None = None,
        grip: str | None = None,
        name: str = "inverse3",
        clock: Callable[[], float] = time.perf_counter,
    ):
        self._service, self._device, self._grip, self._name, self._clock = service, device, grip, name, clock
        self.info = DeviceInfo(name=name, kind="inverse3", force=FORCE, continuous_force=CONTINUOUS_FORCE)
        self._link: ServiceLink | None = None
        self.address = ""

    @property
    def ignored(self) -> int:
        """How many messages were not what the protocol says since it was opened."""
        return self._link.ignored if self._link else 0

    def open(self) -> None:
        """Connect, choose the device, begin to talk.

        Raises:
            InputError: `websockets` is not installed, the service is not there or not one, it has no such device, or
                another side has it.
        """
        self.close()
        socket, inventory = connect(self._service, self._name)
        try:
            device = self._choose(inventory)
            if device in inventory.unready:
                raise InputError(
                    f"device {self._name!r}: Inverse3 {device} must be ready; see its power and its lights"
                )
            grip = self._grip
            if grip is None and (place := inventory.devices.index(device)) < len(inventory.grips):
                grip = inventory.grips[place]
            exchange = Exchange(self._name, self._clock)
            link = ServiceLink(socket, exchange, device, grip, inventory.key)
            with _guard:
                if device in _taken:
                    raise InputError(f"device {self._name!r}: is open already; each hand must have its own")
                _taken.add(device)
        except InputError:
            socket.close()
            raise
        self.address = json.dumps([self._service, device, inventory.key])
        link.start()
        self._link, self._device = link, device  # after a loss, the same one must come back

    def _choose(self, inventory: Inventory) -> str:
        """Id of the device to take."""
        with _guard:
            free = [device for device in inventory.devices if device not in _taken]
        listed = ", ".join(inventory.devices) or "none"
        if self._device is None and not free:
            raise InputError(f"device {self._name!r}: no free Inverse3 at {self._service}; it has {listed}")
        if self._device is not None and self._device not in inventory.devices:
            raise InputError(f"device {self._name!r}: no Inverse3 {self._device!r} at {self._service}; it has {listed}")
        if self._grip is not None and self._grip not in inventory.grips:
            grips = ", ".join(inventory.grips) or "none"
            raise InputError(f"device {self._name!r}: no handle {self._grip!r} at {self._service}; it has {grips}")
        return self._device or free[0]

    def read(self, time: float) -> DeviceSample:
        """See `Device`."""
        if self._link is None:
            raise DeviceLost(f"{self._name} is not open")
        return self._link.exchange.read(time)

    def write(self, force: Vec3) -> None:
        """See `Device`."""
        if self._link is None:
            raise DeviceLost(f"{self._name} is not open")
        self._link.exchange.write(force)
        self._link.wake.set()

    def close(self) -> None:
        """See `Device`; the last force is zero."""
        link, self._link = self._link, None
        if link is not None:
            link.stop()


_taken: set[str] = set()
"""Ids of the devices that sides of this process have: the service adds up what several clients command."""
_guard = threading.Lock()


class ServiceLink:
    """The thread that talks to the service for one device.

    Args:
        socket: An open connection of `websockets`.
        exchange: Where the servo meets it.
        device: Id of the Inverse3.
        grip: Id of the handle, or None.
        key: What a force is called by this service.
    """

    def __init__(self, socket: Any, exchange: Exchange, device: str, grip: str | None, key: str):
        self._socket, self.exchange, self._device, self._grip, self._key = socket, exchange, device, grip, key
        self.wake = threading.Event()
        self.ignored = 0
        self._absent = 0
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name=f"inverse3 {device}", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Zero force, then the end of the thread."""
        self._stopping = True
        self.wake.set()
        self._thread.join(ANSWER_WITHIN + 2.0 * CLOSE_WITHIN)

    def _run(self) -> None:
        socket, exchange = self._socket, self.exchange
        try:
            message: str | None = greeting(self._device, self._key)
            while not self._stopping and exchange.lost is None:
                socket.send(message or force_command(self._device, exchange.force(), self._key))
                message = None
                self._hear()
                self.wake.wait(PACE)
                self.wake.clear()
            socket.send(force_command(self._device, ZERO, self._key))
        except Exception as error:  # a connection that has ended, or whatever else a library raises
            exchange.lose(f"connection to the Inverse Service ended ({' '.join(str(error).split())})")
        finally:
            try:
                socket.close()
            finally:
                with _guard:
                    _taken.discard(self._device)

    def _hear(self) -> None:
        """The newest of the answers that are there, after waiting for one."""
        newest: bytes | None = None
        try:
            newest = self._socket.recv(timeout=ANSWER_WITHIN, decode=False)
            for _ in range(MOST_ANSWERS - 1):
                newest = self._socket.recv(timeout=0, decode=False)
        except TimeoutError:
            pass
        if newest is None:
            return
        try:
            state = read_state(newest, self._device, self._grip)
        except BadMessage:
            self.ignored += 1
            return
        self._absent = 0 if state.present else self._absent + 1
        if self._absent >= ABSENCES:
            self.exchange.lose("the Inverse Service does not list it any more")
        elif state.position is not None:
            self.exchange.put(state.position, state.buttons)


def connect(service: str, what: str) -> tuple[Any, Inventory]:
    """An open connection and what the service has.

    Args:
        service: Address.
        what: As the user named the device, for messages.

    Raises:
        InputError: `websockets` is not installed, or no Inverse Service is there.
    """
    try:
        from websockets.exceptions import WebSocketException
        from websockets.sync.client import connect as open_socket
    except ImportError:
        raise InputError(f"device {what!r}: needs the package websockets: pip install 'otwarp[haptics]'") from None
    try:
        socket = open_socket(
            service,
            open_timeout=CONNECT_WITHIN,
            close_timeout=CLOSE_WITHIN,
            ping_interval=None,
            compression=None,
            max_size=LARGEST,
            proxy=None,
        )
    except (OSError, WebSocketException, ValueError) as error:
        kind = what.partition(":")[0]
        helps = (
            "start it there, or correct the address" if "://" in what else f"start it, or name {kind}:ws://host:port"
        )
        raise InputError(
            f"device {what!r}: no Haply Inverse Service at {service} ({' '.join(str(error).split()) or 'no answer'}); "
            f"{helps}"
        ) from None
    try:
        return socket, read_inventory(socket.recv(timeout=CONNECT_WITHIN, decode=False))
    except (OSError, WebSocketException, BadMessage) as error:
        socket.close()
        raise InputError(
            f"device {what!r}: {service} is no Haply Inverse Service of version 3.1 or later "
            f"({' '.join(str(error).split()) or 'it says nothing'})"
        ) from None


class ZeroCursorForce:
    """Zero force by a connection of its own, made when it is needed: the service adds up what its clients command.

    What a service does with the last force of a client that has gone is not documented; see `core.ZeroForce`.

    Args:
        service: Address.
        device: Id of the Inverse3.
        key: What a force is called by this service.

    Raises:
        InputError: `websockets` is not installed, or no Inverse Service is there.
    """

    def __init__(self, service: str, device: str, key: str):
        self._service, self._device, self._key = service, device, key
        self._socket: Any = None
        connect(service, f"inverse3:{device}")[0].close()  # imports, too, what takes longer than there is time

    def send(self) -> None:
        """See `ZeroForce`."""
        if self._socket is None:
            self._socket, _ = connect(self._service, f"inverse3:{self._device}")
        try:
            self._socket.send(force_command(self._device, ZERO, self._key))
            self._socket.recv(timeout=ANSWER_WITHIN, decode=False)
        except TimeoutError:
            pass
        except Exception:
            self.close()
            raise

    def close(self) -> None:
        """See `ZeroForce`."""
        socket, self._socket = self._socket, None
        if socket is not None:
            socket.close()


def zero_force(address: str) -> ZeroCursorForce:
    """What the guardian sends."""
    return ZeroCursorForce(*json.loads(address))


def create(spec: DeviceSpec) -> Inverse3Device:
    """`haply`, `inverse3:ID`, `inverse3:ws://host:port`, `inverse3:ws://host:port/ID`, each with `,grip=ID`."""
    where = f"device {spec.text!r}"
    argument, found = parse_parameters(where, spec.argument or "", ("grip",))
    service, device = SERVICE, argument or None
    if "://" in argument:
        try:
            parts = urlsplit(argument)
            port = parts.port  # raises for one that cannot be
        except ValueError as error:
            raise InputError(f"{where}: address {argument!r}: {error}") from None
        if parts.scheme not in ("ws", "wss") or not parts.hostname or port == 0 or parts.query or parts.fragment:
            raise InputError(f"{where}: address {argument!r} must be ws://host:port or ws://host:port/id")
        service, device = f"{parts.scheme}://{parts.netloc}", parts.path.strip("/") or None
    for label, text in (("id", device), ("grip", found.get("grip"))):
        if text is not None and not re.fullmatch(r"[0-9A-Za-z_.-]{1,64}", text):
            raise InputError(f"{where}: {label} {text!r} must be 1 to 64 letters, digits or '_.-'")
    return Inverse3Device(service, device, found.get("grip"), spec.text)


def find_devices(service: str = SERVICE) -> tuple[str, ...]:
    """A line for each Inverse3 of a service: what to type, and the handle whose buttons it gets.

    Raises:
        InputError: `websockets` is not installed, or the service is not there.
    """
    socket, inventory = connect(service, "inverse3")
    socket.close()
    lines = []
    for place, device in enumerate(inventory.devices):
        spec = f"inverse3:{device}" if service == SERVICE else f"inverse3:{service}/{device}"
        handle = inventory.grips[place] if place < len(inventory.grips) else "none"
        lines.append(f"{spec}  Haply Inverse3, handle {handle}")
    return tuple(lines)
