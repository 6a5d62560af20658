"""Force Dimension devices and the Novint Falcon: `forcedimension`, `forcedimension:10742`, `forcedimension:index=1`.

By the package forcedimension-core 1.0 (LGPL-3), which loads the maker's proprietary SDK (3.16 or later) when it is
imported. The SDK's calls exchange USB messages and may wait, so a thread of ours makes them: each force that the servo
writes wakes it, it sets the force and gets position and buttons. An `Exchange` joins the two.

The SDK's axes are x towards the user, y right, z up (as CHAI3D, which takes its positions unchanged, documents them);
ours are x right, y up, z towards the user.

The SDK ends with its process. What takes the force of a servo off that was killed or stopped is the watchdog in the
device's firmware, `WATCHDOG`, which some models lack.

Never met hardware, nor the SDK: tests put a module with the package's functions in its place.
"""

from __future__ import annotations

import contextlib
import io
import threading
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.core import DeviceInfo, DeviceLost, DeviceSample, Vec3
from otwarp.haptics.devices import DeviceSpec
from otwarp.haptics.devices.exchange import Exchange

LARGEST_FORCE = {60: 8.0, 63: 20.0, **dict.fromkeys((33, 34, 35, 36, 37), 12.0)}
"""Newtons by number of `DeviceType` (Falcon, delta.3, omega.3, .6 and .7), as CHAI3D's driver of these devices has
them; the SDK does not say."""
OTHER_FORCE = 8.0
"""Newtons for every other type: the least of the above."""
CONTINUOUS = 1.0 / 3.0
"""Share of the largest force that may be held for ever: ours, on the cautious side."""
PACE = 0.01
"""Seconds without a write of the servo after which the device is served all the same, so that its force fades."""
STOP_WITHIN = 1.0
"""Seconds for the thread to end; a call of the SDK takes about one millisecond."""
TICK = 125e-6
"""Unit of the firmware's watchdog [s]."""
WATCHDOG = 255
"""Ticks without a force after which the firmware takes all forces off: the most that there is, 32 ms, as CHAI3D sets
it; three times `PACE`."""
OFF_BY_WATCHDOG = 3
"""The SDK's number (`ForceOffCause`) for forces that the watchdog took off; they stay off until enabled again."""
TIMEGUARD = 1
"""What the SDK returns when it was asked again too early: the position is the one before."""
MOST_SERIAL, MOST_INDEX = 0xFFFF, 255
"""Serial numbers of the SDK are unsigned shorts; no machine has more devices than that."""
MOST_DIGITS = 9
"""More make no such number, and Python refuses to read very many."""

_open: set[int] = set()
"""The SDK's ids of devices that sides of this process have."""
_guard = threading.Lock()
"""Over `_open`, and over opening and closing, which change what the SDK takes for its default device."""


def sdk() -> Any:
    """The functions of the SDK, `forcedimension_core.dhd`.

    Raises:
        InputError: The package is not installed, or the SDK.
    """
    try:
        # it writes to stderr what the error below says
        with contextlib.redirect_stderr(io.StringIO()):
            return import_module("forcedimension_core").dhd
    except Exception as error:  # no package, no SDK, one that is too old, or a library that lacks a function
        why = _whole_sentences(" ".join(str(error).split())) or type(error).__name__
        raise InputError(
            "Force Dimension: needs forcedimension-core (pip install 'otwarp[forcedimension]') and the maker's SDK "
            f"3.16 or later (libdrd in ~/.local/lib, /usr/local/lib or the folder in FDSDK): {why}"
        ) from None


def _whole_sentences(text: str) -> str:
    """Without a last sentence that ends in a colon, after which the package names nothing."""
    head, stop, tail = text.rpartition(". ")
    return f"{head}." if stop and tail.rstrip().endswith(":") else text.rstrip(": ")


def last_error(dhd: Any) -> str:
    """The last error of the calling thread, on one line."""
    return " ".join(str(dhd.errorGetLastStr()).split()) or "error of the SDK"


def watch(dhd: Any, number: int) -> bool:
    """Set the watchdog of an open device's firmware; whether the device has one."""
    dhd.expert.enableExpertMode()
    try:
        return dhd.expert.setWatchdog(WATCHDOG, number) >= 0
    finally:
        dhd.expert.disableExpertMode()


def largest_force(dhd: Any, number: int) -> float:
    """Largest force of an open device [N], by its type."""
    return LARGEST_FORCE.get(int(dhd.getSystemType(number)), OTHER_FORCE)


class ForceDimensionDevice:
    """A delta, omega, sigma or lambda, or a Falcon; rotations and grippers are left alone.

    Args:
        serial: Serial number, or None to go by `index`.
        index: Place among the devices that are found; changes when one is added or removed.
        name: As the user named it.
        clock: Of the force's age [s].

    Attributes:
        watched: Whether the firmware takes forces off when this process cannot.
    """

    def __init__(
        self,
        serial: int | None = None,
        index: int = 0,
        name: str = "forcedimension",
        clock: Callable[[], float] = time.perf_counter,
    ):
        self._serial, self._index, self._name, self._clock = serial, index, name, clock
        self._force = OTHER_FORCE
        self.watched = False
        self._service: Service | None = None

    @property
    def info(self) -> DeviceInfo:
        """See `Device`; the force is that of the device's type, once it was opened."""
        return DeviceInfo(
            name=self._name,
            kind="forcedimension",
            force=self._force,
            continuous_force=CONTINUOUS * self._force,
        )

    def open(self) -> None:
        """Find it, enable its forces at zero force, begin to serve it.

        Raises:
            InputError: Package or SDK is not installed, the device is not there, or another side has it.
        """
        self.close()
        dhd = sdk()
        with _guard:
            number = self._find(dhd)
            if number in _open:
                raise InputError(f"device {self._name!r}: is open already; each hand must have its own")
            if dhd.setForce((0.0, 0.0, 0.0), number) < 0 or dhd.enableForce(True, number) < 0:
                why = last_error(dhd)
                dhd.close(number)
                raise InputError(f"device {self._name!r}: forces cannot be enabled: {why}")
            self._force = largest_force(dhd, number)
            self.watched = watch(dhd, number)
            # places change when a device is unplugged; the one that comes back must be the same
            if self._serial is None and (serial := dhd.getSerialNumber(number)) > 0:
                self._serial = serial
            _open.add(number)
        self._service = Service(dhd, number, Exchange(self._name, self._clock), self._clock)
        self._service.start()

    def _find(self, dhd: Any) -> int:
        """The SDK's id of the device, opened."""
        if self._serial is not None:
            number, what = dhd.openSerial(self._serial), f"serial number {self._serial}"
        else:
            count = dhd.getDeviceCount()
            if self._index >= count:
                raise InputError(f"device {self._name!r}: index = {self._index}: {max(count, 0)} found")
            number, what = dhd.openID(self._index), f"index {self._index}"
        if number < 0:
            raise InputError(f"device {self._name!r}: {what} cannot be opened: {last_error(dhd)}")
        return number

    def read(self, time: float) -> DeviceSample:
        """See `Device`."""
        if self._service is None:
            raise DeviceLost(f"{self._name} is not open")
        return self._service.exchange.read(time)

    def write(self, force: Vec3) -> None:
        """See `Device`."""
        if self._service is None:
            raise DeviceLost(f"{self._name} is not open")
        self._service.exchange.write(force)
        self._service.wake.set()

    def close(self) -> None:
        """See `Device`; the force is zero and the brakes are on, so that an arm does not drop."""
        service, self._service = self._service, None
        if service is not None:
            service.stop()


class Service:
    """The thread that serves one device; all calls about it from opening to closing are made there.

    Args:
        dhd: Functions of the SDK.
        number: The SDK's id of the device.
        exchange: Where the servo meets it.
        clock: Of the time between two forces [s].
    """

    def __init__(self, dhd: Any, number: int, exchange: Exchange, clock: Callable[[], float]):
        self._dhd, self._number, self.exchange, self._clock = dhd, number, exchange, clock
        self._sent = clock()
        self.wake = threading.Event()
        self._stopping = False
        self._place = [0.0, 0.0, 0.0]
        self._thread = threading.Thread(target=self._run, name=f"forcedimension {number}", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Zero force, then the end of the thread."""
        self._stopping = True
        self.wake.set()
        self._thread.join(STOP_WITHIN)

    def _run(self) -> None:
        try:
            while not self._stopping and self.exchange.lost is None:
                self._turn()
                self.wake.wait(PACE)
                self.wake.clear()
        except Exception as error:  # whatever the package raises, the servo must hear of it
            self.exchange.lose(f"{type(error).__name__}: {error}")
        finally:
            self._let_go()

    def _turn(self) -> None:
        """One exchange with the device. The SDK keeps its last error per thread, so it is asked for here."""
        dhd, number, place = self._dhd, self._number, self._place
        now = self._clock()
        if now - self._sent > WATCHDOG * TICK:
            self._enable_again()
        self._sent = now
        x, y, z = self.exchange.force()
        set_force = dhd.setForce((z, x, y), number)
        got_position = dhd.getPosition(place, number) if set_force >= 0 else -1
        if got_position < 0:
            self.exchange.lose(last_error(dhd))
        elif got_position != TIMEGUARD:
            self.exchange.put((place[1], place[2], place[0]), dhd.getButtonMask(number))

    def _enable_again(self) -> None:
        """After a silence, enable the forces that the watchdog took off; not those that the user did, by the button."""
        status = import_module("forcedimension_core.containers").Status()
        known = self._dhd.getStatus(status, self._number) >= 0
        if known and not status.force and status.forceoffcause == OFF_BY_WATCHDOG:
            self._dhd.enableForce(True, self._number)

    def _let_go(self) -> None:
        dhd, number = self._dhd, self._number
        with _guard:
            try:
                dhd.setForce((0.0, 0.0, 0.0), number)
                dhd.stop(number)
                dhd.close(number)
            finally:
                _open.discard(number)


def create(spec: DeviceSpec) -> ForceDimensionDevice:
    """`forcedimension`, `forcedimension:SERIAL` or `forcedimension:index=N`."""
    if spec.argument is None:
        return ForceDimensionDevice(None, spec.ordinal, spec.text)
    head, equals, tail = spec.argument.partition("=")
    number, limit = (tail, MOST_INDEX) if equals else (head, MOST_SERIAL)
    valid = number.isascii() and number.isdigit() and len(number) <= MOST_DIGITS and int(number) <= limit
    if not valid or (equals and head.strip() != "index"):
        raise InputError(
            f"device {spec.text!r}: must be forcedimension:<serial number to {MOST_SERIAL}> or "
            f"forcedimension:index=<0 to {MOST_INDEX}>"
        )
    if equals:
        return ForceDimensionDevice(None, int(number), spec.text)
    return ForceDimensionDevice(int(number), 0, spec.text)


def find_devices() -> tuple[str, ...]:
    """A line for each device that can be opened: what to type, its type, its largest force.

    Raises:
        InputError: Package or SDK is not installed.
    """
    dhd, lines = sdk(), []
    with _guard:
        for index in range(max(dhd.getDeviceCount(), 0)):
            number = dhd.openID(index)
            if number < 0:
                continue
            serial = dhd.getSerialNumber(number)
            spec = f"forcedimension:{serial}" if serial > 0 else f"forcedimension:index={index}"
            kind = dhd.getSystemName(number) or "unknown type"
            lines.append(f"{spec}  {kind}, {largest_force(dhd, number):g} N")
            if number not in _open:
                dhd.close(number)
    return tuple(lines)
