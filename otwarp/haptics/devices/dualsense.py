"""A Sony DualSense: a stick and the triggers are the hand's velocity; rumble and stiff triggers stand in for force.

It cannot push. The size of the force, as a part of `force`, shakes both motors and stiffens both
triggers; its direction is lost. `DeviceInfo.force` is therefore no force of the device but the one that is rendered as
the strongest effect.

The binding never met a DualSense. Its decoder and checksums are tested on bytes that others recorded by Bluetooth, and
on bytes made to the documented layout; what it sends was never felt.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

from otwarp.haptics.core.types import ZERO, DeviceInfo, DeviceLost, DeviceSample, Vec3
from otwarp.haptics.devices import DeviceSpec
from otwarp.haptics.devices.dualsense_report import (
    CALIBRATION,
    CALIBRATION_SIZE,
    OFF,
    STRONGEST,
    Feel,
    decode,
    encode_bluetooth,
    encode_usb,
)
from otwarp.haptics.devices.exchange import LatestSender
from otwarp.haptics.devices.hid import (
    HidFound,
    HidPort,
    HidSystem,
    HidWanted,
    RateHand,
    describe_devices,
    open_hid,
    parse_argument,
    waiting_reports,
)
from otwarp.haptics.devices.hid_ports import address_of, found_at, hid_system, open_beside

MODELS = {(0x054C, 0x0CE6): "DualSense", (0x054C, 0x0DF2): "DualSense Edge"}
"""By (vendor, product); those that the Linux driver calls PS5 controllers."""
USAGE = (0x01, 0x05)
"""Generic Desktop, Game Pad."""
SILENCE = 0.1
"""Seconds without a report after which sticks and buttons count as released: it reports all the time, every 4 ms by
USB."""
MOST_REPORTS = 64
"""Taken in one reading; as many as Linux keeps."""
USB_RATE, BLUETOOTH_RATE = 100.0, 30.0
"""Most output reports per second. By Bluetooth they share the air with what the controller says."""
REFRESH = 0.5
"""Seconds after which an effect that stays is sent again: a motor may time out, and a report may be lost."""

RANGES = {
    "speed": (0.1, 1e-4, 1.0),
    "dead_zone": (0.1, 0.0, 0.9),
    "force": (3.3, 0.01, 100.0),
    "rumble": (1.0, 0.0, 1.0),
    "triggers": (1.0, 0.0, 1.0),
}
"""Parameters: default, least, most. Full speed [m/s], dead zone as a part of full deflection, force of the strongest
effect [N] (that of a Touch), and how much of their range motors and triggers use. Sticks were recorded at rest within
3 % of the middle."""
WORDS = {"stick": ("left", "right")}


class Sends(Protocol):
    """What carries effects to the controller, see `LatestSender`."""

    def put(self, latest: Feel) -> None:
        """Hand over the newest; never waits."""
        ...

    def close(self, last: Feel, wait: bool = True) -> None:
        """Send the last, and close the port; without `wait` behind the caller's back."""
        ...


class DualSense:
    """A hand that a DualSense moves.

    Right, left, towards and away from the user by the stick; up by R2, down by L2.

    Args:
        wanted: Which one.
        numbers: By name, see `RANGES`; what is missing has its default.
        stick: `left` or `right`.
        system: That lists and opens HID devices; None takes the machine's.
        sender: Makes what sends effects: a thread, because a transfer waits.
    """

    def __init__(
        self,
        wanted: HidWanted,
        numbers: dict[str, float] | None = None,
        stick: str = "left",
        system: HidSystem | None = None,
        sender: Callable[[Callable[[Feel], None], Callable[[], None]], Sends] = LatestSender,
    ):
        given = {key: default for key, (default, _, _) in RANGES.items()} | (numbers or {})
        self._wanted, self._system, self._make_sender = wanted, system, sender
        self._stick_is_left = stick == "left"
        self._full = given["force"]
        self._motors, self._triggers = 255.0 * given["rumble"], STRONGEST * given["triggers"]
        self._info = DeviceInfo(
            name=wanted.text,
            kind="dualsense",
            force=self._full,
            continuous_force=self._full,
            absolute=False,
            met_hardware=False,
        )
        self._hand = RateHand(given["speed"], given["dead_zone"])
        self._port: HidPort | None = None
        self._sender: Sends | None = None
        self._before: HidFound | None = None
        self.address = ""
        self._rest()

    def _rest(self) -> None:
        """Nothing is pushed, held or felt."""
        self._deflection: Vec3 = ZERO
        self._buttons = 0
        self._heard = self._sent_at = -math.inf
        self._time = 0.0
        self._sent: Feel | None = None
        self._period = 1.0 / USB_RATE

    @property
    def info(self) -> DeviceInfo:
        """See `Device`; `force` is what is rendered as the strongest effect."""
        return self._info

    def open(self) -> None:
        """Find it, take it, and by Bluetooth ask it for its full reports.

        Raises:
            InputError: It is not there, in use, or may not be opened.
        """
        self.close()
        port = open_hid(self._wanted, self._system or hid_system(), self._before)
        self._rest()
        self._hand.stop()
        if port.found.bluetooth:
            self._period = 1.0 / BLUETOOTH_RATE
            with suppress(OSError):  # its simple reports will do
                port.feature(CALIBRATION, CALIBRATION_SIZE)
        self._port, self._before, self.address = port, port.found, address_of(port.found)
        self._sender = self._make_sender(_sending(port), port.close)

    def read(self, time: float) -> DeviceSample:
        """See `Device`."""
        port = self._port
        if port is None:
            raise DeviceLost(f"{self._info.name} is not open")
        fresh = False
        try:
            for report in waiting_reports(port, MOST_REPORTS):
                fresh |= self._take(report, port.found.bluetooth)
        except OSError as error:
            raise self._lost(error) from None
        self._time = time
        if fresh:
            self._heard = time
        elif time - self._heard > SILENCE:
            self._deflection, self._buttons = ZERO, 0
        return DeviceSample(time, self._hand.move(time, self._deflection), self._buttons, fresh)

    def _take(self, report: bytes, bluetooth: bool) -> bool:
        """Take in a report, if it is a sound one."""
        pad = decode(report, bluetooth)
        if pad is None:
            return False
        x, z = pad.left if self._stick_is_left else pad.right
        down, up = pad.pull
        self._deflection, self._buttons = (x, up - down, z), pad.buttons
        return True

    def write(self, force: Vec3) -> None:
        """Render the size of a force [N]; handed to the sender at most at the link's rate, and never waits.

        Raises:
            DeviceLost: It is not open, or an earlier effect could not be sent.
        """
        sender = self._sender
        if sender is None:
            raise DeviceLost(f"{self._info.name} is not open")
        since = self._time - self._sent_at
        if since < self._period:
            return
        feel = self._felt(force)
        if feel == self._sent and (feel == OFF or since < REFRESH):
            return
        try:
            sender.put(feel)
        except OSError as error:
            raise self._lost(error) from None
        self._sent, self._sent_at = feel, self._time

    def _felt(self, force: Vec3) -> Feel:
        """The effect of a force; none for one that is not finite."""
        level = math.hypot(*force) / self._full
        if not level < math.inf:
            return OFF
        level = min(level, 1.0)
        return Feel(round(self._motors * level), round(self._triggers * level))

    def _lost(self, error: OSError) -> DeviceLost:
        self._let_go(wait=False)  # the loop of the other device must not wait for one that hangs
        return DeviceLost(error.strerror or str(error))

    def close(self) -> None:
        """See `Device`; motors off, triggers loose."""
        self._let_go(wait=True)

    def _let_go(self, wait: bool) -> None:
        """Leave the port to the sender, which closes it after the last report."""
        sender, self._sender, self._port = self._sender, None, None
        if sender is not None:
            sender.close(OFF, wait)


def _sending(port: HidPort) -> Callable[[Feel], None]:
    """What writes effects to a port as its link wants them."""
    if not port.found.bluetooth:
        return lambda feel: port.write(encode_usb(feel))
    sequence = 0

    def send(feel: Feel) -> None:
        """Write one, numbered."""
        nonlocal sequence
        port.write(encode_bluetooth(feel, sequence))
        sequence += 1

    return send


def create(spec: DeviceSpec, system: HidSystem | None = None) -> DualSense:
    """`dualsense`, `dualsense:SERIAL`, `dualsense:#2`, each with the parameters of `RANGES` and `stick=right`.

    Raises:
        InputError: Its argument is bad.
    """
    serial, ordinal, numbers, words = parse_argument(spec, RANGES, WORDS)
    return DualSense(_wanted(spec.text, serial, ordinal), numbers, words["stick"], system)


class ZeroEffect:
    """Motors off and triggers loose, beside the servo that holds the device; see `core.types.ZeroForce`.

    Args:
        found: The device.
        open_port: Opens it.

    Raises:
        OSError: It cannot be opened.
    """

    def __init__(self, found: HidFound, open_port: Callable[[HidFound], HidPort] = open_beside):
        self._found, self._open = found, open_port
        open_port(found).close()  # one that may not be opened is told before it matters

    def send(self) -> None:
        """See `ZeroForce`; opened anew, for the device may have been plugged in again meanwhile."""
        port = self._open(self._found)
        try:
            _sending(port)(OFF)
        finally:
            port.close()

    def close(self) -> None:
        """See `ZeroForce`."""


def zero_force(address: str) -> ZeroEffect:
    """What the guardian sends; a controller keeps its last effect when nobody writes."""
    return ZeroEffect(found_at(address))


def find_devices(system: HidSystem | None = None) -> tuple[str, ...]:
    """One line per DualSense that is plugged in or connected, which begins with the text to ask for it by.

    Raises:
        InputError: A package is needed here, and absent.
    """
    return describe_devices("dualsense", _wanted("dualsense"), system or hid_system())


def _wanted(text: str, serial: str | None = None, ordinal: int = 0) -> HidWanted:
    return HidWanted(text=text, what="DualSense", models=MODELS, usage=USAGE, serial=serial, ordinal=ordinal)
