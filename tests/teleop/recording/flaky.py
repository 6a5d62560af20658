"""A device that is unplugged while a file exists; importing this makes its kind known, in the servo as well."""

from __future__ import annotations

from pathlib import Path

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import make_chain
from otwarp.haptics.core import DeviceLost, DeviceSample
from otwarp.haptics.devices import KINDS, DeviceSpec, Kind
from otwarp.haptics.devices.virtual import HandModel, VirtualDevice

FLAKY = "flaky"
ROW = Kind("tests.teleop.recording.flaky:create", "required", "a file", True)
KINDS[FLAKY] = ROW


class FlakyDevice(VirtualDevice):
    def __init__(self, switch: Path):
        super().__init__(lambda time: (0.004, 0.0, 0.0), HandModel(mass=0.15))
        self.switch = switch

    def open(self) -> None:
        if self.switch.exists():
            raise InputError("flaky: not there")
        super().open()

    def read(self, time: float) -> DeviceSample:
        if self.switch.exists():
            raise DeviceLost("unplugged")
        return super().read(time)


def create(spec: DeviceSpec) -> FlakyDevice:
    return FlakyDevice(Path(spec.argument))


def make(*arguments):
    """`make_chain`, from a module that knows the device."""
    return make_chain(*arguments)
