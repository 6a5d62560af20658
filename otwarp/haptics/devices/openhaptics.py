"""3D Systems Touch and its kin by OpenHaptics: `openhaptics`, `openhaptics:"Left Geomagic Touch"`.

All devices are served by one asynchronous callback of the library's scheduler, in the library's servo thread (1 kHz).
It takes the position and leaves the newest force of each; an `Exchange` per device joins it to our servo. The device
frame is OpenHaptics': x right, y up, z towards the user; millimetres are turned to metres. Button 1 is bit 0
(dead-man), button 2 bit 1 (clutch).

Never met hardware: tests run it against a double compiled from C (`tests/haptics/libhd_double.c`).
"""

from __future__ import annotations

import atexit
import ctypes
import math
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, DeviceInfo, DeviceLost, DeviceSample, Vec3
from otwarp.haptics.devices import DeviceSpec
from otwarp.haptics.devices import libhd as hdapi
from otwarp.haptics.devices.exchange import Exchange
from otwarp.haptics.devices.libhd import ErrorInfo, LibHD, library_path

METRE = 1e-3
"""Metres per millimetre, the library's unit of length."""
TOUCH_FORCES = (3.3, 0.88)
"""Largest and continuous force [N] of a device that does not say: the Touch's, by its maker's data sheet."""
ANSWER_WITHIN = 2.0
"""Seconds in which the scheduler must have served a device that was added, or taken leave of one that goes."""
FAREWELLS = 5
"""Ticks for which a device that goes gets zero force before it is given up."""


class Served:
    """A device in the scheduler's list. The callback alone writes `phase` and `forces`, the owner alone `leaving`.

    Args:
        handle: HHD.
        exchange: Where the servo meets it.
    """

    def __init__(self, handle: int, exchange: Exchange):
        self.handle, self.exchange = handle, exchange
        self.phase = "new"  # then "on", "ending", "off"
        self.leaving = False
        self.begun, self.ended = threading.Event(), threading.Event()
        self.forces = TOUCH_FORCES
        self.warnings = self.farewells = 0
        self.vector = (ctypes.c_double * 3)()
        self.integer = ctypes.c_int()

    def lose(self, why: str) -> None:
        """It is gone, or cannot be relied on; the next tick takes leave of it."""
        self.exchange.lose(why)
        self.phase = "ending"
        self.begun.set()

    def end(self) -> None:
        """It has had its last frame: whoever waits for its begin or end goes on."""
        self.phase = "off"
        self.begun.set()
        self.ended.set()


class Scheduler:
    """The library's scheduler with one callback for all devices; it runs while any of them is open.

    Args:
        hd: The library.
    """

    def __init__(self, hd: LibHD):
        self.hd = hd
        self._served: tuple[Served, ...] = ()  # replaced whole, so the callback needs no lock
        self._lock = threading.RLock()
        self._operation: int | None = None
        self._callback = hdapi.SchedulerCallback(self._tick)  # must outlive its schedule

    @property
    def running(self) -> bool:
        """Whether the callback is scheduled."""
        return self._operation is not None

    def attach(self, name: str | None, exchange: Exchange, what: str) -> Served:
        """Find a device, enable its forces and serve it, at zero force.

        The library's scheduler goes on while the device is initialised: another device may be under force.

        Args:
            name: As configured in Touch Setup, or None for the default device.
            exchange: Where the servo meets it.
            what: As the user named it, for messages.

        Raises:
            InputError: It is not there, another side has it, or the scheduler does not serve it.
        """
        with self._lock:
            self.hd.errors()
            handle = self.hd.hdInitDevice(None if name is None else name.encode())
            errors = self.hd.errors()
            taken = any(error.code == hdapi.DEVICE_ALREADY_INITIATED for error in errors)
            if taken or any(served.handle == handle for served in self._served):
                raise InputError(f"device {what!r}: is open already; each hand must have its own")
            if errors or handle == hdapi.INVALID_HANDLE:
                why = self.hd.text(errors[0]) if errors else "no handle"
                raise InputError(f"device {what!r}: cannot be opened: {why}; its name must be one of Touch Setup's")
            served = Served(handle, exchange)
            self._served = (*self._served, served)
            try:
                self._start(what)
                if not served.begun.wait(ANSWER_WITHIN):
                    raise InputError(f"device {what!r}: the scheduler of OpenHaptics does not serve it")
                if exchange.lost is not None:
                    raise InputError(f"device {what!r}: {exchange.lost}")
            except InputError:
                self.detach(served)
                raise
            return served

    def _start(self, what: str) -> None:
        if self.running:
            return
        self._operation = self.hd.hdScheduleAsynchronous(self._callback, None, hdapi.MAX_PRIORITY)
        self.hd.hdStartScheduler()
        atexit.register(self.shutdown)  # a callback into an interpreter that has ended would crash it
        if errors := self.hd.errors():
            raise InputError(f"device {what!r}: the scheduler of OpenHaptics does not start: {self.hd.text(errors[0])}")

    def detach(self, served: Served) -> None:
        """Zero its force, let go of it; with the last device the scheduler stops. May be called more than once."""
        with self._lock:
            if served not in self._served:
                return
            served.leaving = True
            served.ended.wait(ANSWER_WITHIN)  # the callback leaves zero force; a dead scheduler leaves none either
            self._served = tuple(s for s in self._served if s is not served)
            if not self._served and self._operation is not None:
                self.hd.hdStopScheduler()
                self.hd.hdUnschedule(self._operation)
                self._operation = None
                atexit.unregister(self.shutdown)
            self.hd.hdDisableDevice(served.handle)
            self.hd.errors()

    def shutdown(self) -> None:
        """Let go of every device."""
        for served in self._served:
            self.detach(served)

    def _tick(self, _user: int | None) -> int:
        """The callback: one frame of each device. What it raises would be lost, and the device served on."""
        for served in self._served:
            try:
                if served.phase == "off":
                    continue
                if served.leaving or served.phase == "ending":
                    self._farewell(served)
                else:
                    self._frame(served)
            except Exception as error:
                served.lose(f"{type(error).__name__}: {error}")
                if served.farewells >= FAREWELLS:
                    served.end()
        return hdapi.CALLBACK_CONTINUE

    def _frame(self, served: Served) -> None:
        """Position, buttons, force of one device; its errors end it, and no other."""
        hd, handle, vector = self.hd, served.handle, served.vector
        hd.hdMakeCurrentDevice(handle)
        hd.hdBeginFrame(handle)
        try:
            if served.phase == "new" and not self._blame(served, hd.errors()):
                served.forces = nominal_forces(hd)
                hd.hdEnable(hdapi.FORCE_OUTPUT)
            hd.hdGetDoublev(hdapi.CURRENT_POSITION, vector)
            hd.hdGetIntegerv(hdapi.CURRENT_BUTTONS, served.integer)
            position = (METRE * vector[0], METRE * vector[1], METRE * vector[2])
            vector[:] = served.exchange.force() if served.phase == "on" else ZERO
            mine = self._hold_current(handle)
            hd.hdSetDoublev(hdapi.CURRENT_FORCE, vector)
        finally:
            hd.hdEndFrame(handle)
        if self._blame(served, hd.errors()) or not mine:
            return
        if served.exchange.put(position, served.integer.value) and served.phase == "new":
            served.phase = "on"
            served.begun.set()

    def _farewell(self, served: Served) -> None:
        """A last frame with zero force and the motors off; what a device that is gone says to that is ignored."""
        hd, handle = self.hd, served.handle
        served.farewells += 1
        hd.hdMakeCurrentDevice(handle)
        hd.hdBeginFrame(handle)
        served.vector[:] = ZERO
        mine = self._hold_current(handle)
        hd.hdSetDoublev(hdapi.CURRENT_FORCE, served.vector)
        if mine:
            hd.hdDisable(hdapi.FORCE_OUTPUT)
        hd.hdEndFrame(handle)
        hd.errors()
        if mine or served.farewells >= FAREWELLS:
            served.end()

    def _hold_current(self, handle: int) -> bool:
        """Whether a device is still the current one; makes it so.

        `hdInitDevice` in another thread makes its device the current one, and the documents do not say that this is a
        matter of that thread alone: a position may then be the other's, and a force must not go there.
        """
        if self.hd.hdGetCurrentDevice() == handle:
            return True
        self.hd.hdMakeCurrentDevice(handle)
        return False

    def _blame(self, current: Served, errors: list[ErrorInfo]) -> bool:
        """End the devices that errors are about; True if the current one is among them."""
        for error in errors:
            served = next((s for s in self._served if s.handle == error.handle), current)
            if error.code in hdapi.FORCE_ERRORS:
                served.warnings += 1
            elif served.phase in ("new", "on"):
                served.lose(self.hd.text(error))
        return current.phase == "ending"


def nominal_forces(hd: LibHD) -> tuple[float, float]:
    """Largest and continuous force [N] as the current device says, or the Touch's."""
    said, value = [], (ctypes.c_double * 3)()
    for name, usual in zip((hdapi.NOMINAL_MAX_FORCE, hdapi.NOMINAL_MAX_CONTINUOUS_FORCE), TOUCH_FORCES, strict=True):
        value[0] = 0.0
        hd.hdGetDoublev(name, value)
        said.append(value[0] if not hd.errors() and 0.0 < value[0] < math.inf else usual)
    return said[0], min(said)


_schedulers: dict[str, Scheduler] = {}
_guard = threading.Lock()


def shared_scheduler() -> Scheduler:
    """The one scheduler of this process.

    Raises:
        InputError: OpenHaptics is not installed.
    """
    path = library_path()
    with _guard:
        if path not in _schedulers:
            _schedulers[path] = Scheduler(LibHD(path))
        return _schedulers[path]


class OpenHapticsDevice:
    """A Touch, or another device of OpenHaptics.

    Args:
        device: As named in Touch Setup, or None for the default device.
        name: As the user named it.
        clock: Of the force's age [s].
    """

    def __init__(self, device: str | None, name: str = "openhaptics", clock: Callable[[], float] = time.perf_counter):
        self._device, self._name, self._clock = device, name, clock
        self._scheduler: Scheduler | None = None
        self._served: Served | None = None
        self._exchange = Exchange(name, clock)

    @property
    def info(self) -> DeviceInfo:
        """See `Device`; the forces are those that the device says, once it was opened."""
        force, continuous = self._served.forces if self._served else TOUCH_FORCES
        return DeviceInfo(name=self._name, kind="openhaptics", force=force, continuous_force=continuous)

    @property
    def warnings(self) -> int:
        """How often the library has limited or cut a force by itself since it was opened."""
        return self._served.warnings if self._served else 0

    def open(self) -> None:
        """Initialise it and begin to serve it.

        Raises:
            InputError: OpenHaptics is not installed, the device is not there, or another side has it.
        """
        self.close()
        scheduler = shared_scheduler()
        exchange = Exchange(self._name, self._clock)
        self._served = scheduler.attach(self._device, exchange, self._name)
        self._scheduler, self._exchange = scheduler, exchange

    def read(self, time: float) -> DeviceSample:
        """See `Device`."""
        if self._scheduler is None:
            raise DeviceLost(f"{self._name} is not open")
        return self._exchange.read(time)

    def write(self, force: Vec3) -> None:
        """See `Device`."""
        if self._scheduler is None:
            raise DeviceLost(f"{self._name} is not open")
        self._exchange.write(force)

    def close(self) -> None:
        """See `Device`; the last force is zero."""
        scheduler, self._scheduler = self._scheduler, None
        if scheduler is not None and self._served is not None:
            scheduler.detach(self._served)


def create(spec: DeviceSpec) -> OpenHapticsDevice:
    """`openhaptics` for the default device, `openhaptics:NAME` for one of Touch Setup."""
    if spec.ordinal > 0:  # the library cannot list its devices
        raise InputError(f"device {spec.text!r}: must be openhaptics:<name in Touch Setup>, for both hands")
    if spec.argument is not None and "\0" in spec.argument:
        raise InputError(f"device {spec.text!r}: name must be without NUL")
    return OpenHapticsDevice(spec.argument, spec.text)


def configured_names() -> tuple[str, ...]:
    """Names that Touch Setup has stored: `config/*.config` in GTDD_HOME, /usr/share/3DSystems or ~/.3dsystems."""
    homes = (os.environ.get("GTDD_HOME"), "/usr/share/3DSystems", str(Path.home() / ".3dsystems"))
    found = (file.stem for home in homes if home for file in sorted(Path(home, "config").glob("*.config")))
    return tuple(dict.fromkeys(found))


def find_devices() -> tuple[str, ...]:
    """A line for each device that answers: what to type, model, serial number, forces.

    Raises:
        InputError: OpenHaptics is not installed, or devices are in use in this process.
    """
    scheduler = shared_scheduler()
    if scheduler.running:
        raise InputError("OpenHaptics: must be asked for its devices before any of them is opened")
    hd, lines, serials = scheduler.hd, [], set()
    for name in (*configured_names(), None):
        hd.errors()
        handle = hd.hdInitDevice(None if name is None else name.encode())
        if hd.errors() or handle == hdapi.INVALID_HANDLE:
            continue
        hd.hdMakeCurrentDevice(handle)
        model, serial = (
            (hd.hdGetString(what) or b"").decode(errors="replace").strip()
            for what in (hdapi.DEVICE_MODEL_TYPE, hdapi.DEVICE_SERIAL_NUMBER)
        )
        force, continuous = nominal_forces(hd)
        hd.hdDisableDevice(handle)
        hd.errors()
        if name is None and serial in serials:  # the default device is one of those named
            continue
        serials.add(serial)
        spec = "openhaptics" if name is None else f'openhaptics:"{name}"'
        lines.append(f"{spec}  {model}, serial number {serial}, {force:g} N, {continuous:g} N continuous")
    return tuple(lines)
