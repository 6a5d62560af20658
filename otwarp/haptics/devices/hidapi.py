"""HID devices by the package `hidapi`, for Windows and macOS.

Never ran on either: written from the package's documentation and tested against a double of its module `hid`.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.devices.hid_port import HidFound

LONGEST = 4096
"""Bytes of the longest report that is taken whole."""
BUS_BLUETOOTH = 2
"""HID_API_BUS_BLUETOOTH of hidapi.h, since 0.13."""

_taken: set[str] = set()
"""Paths that are open in this process: hidapi would open one twice."""


class HidapiPort:
    """An open device of hidapi.

    Args:
        found: What it is.
        device: `hid.device()`, opened.
    """

    def __init__(self, found: HidFound, device: Any):
        self._found, self._device = found, device
        _taken.add(found.path)

    @property
    def found(self) -> HidFound:
        """See `HidPort`."""
        return self._found

    def read(self) -> bytes:
        """See `HidPort`."""
        return bytes(self._opened().read(LONGEST))

    def write(self, report: bytes) -> None:
        """See `HidPort`."""
        if self._opened().write(report) < 0:
            raise OSError("hidapi: write failed")

    def feature(self, number: int, size: int) -> bytes:
        """See `HidPort`."""
        return bytes(self._opened().get_feature_report(number, size))

    def close(self) -> None:
        """See `HidPort`."""
        device, self._device = self._device, None
        if device is not None:
            _taken.discard(self._found.path)
            device.close()

    def _opened(self) -> Any:
        if self._device is None:
            raise OSError("hidapi: closed")
        return self._device


class Hidapi:
    """What hidapi lists.

    Args:
        module: `hid`, or a double of it.

    Raises:
        InputError: The package is absent.
    """

    def __init__(self, module: Any = None):
        if module is None:
            try:
                module = import_module("hid")
            except ImportError as error:
                raise InputError(
                    f"HID devices need the package hidapi here: pip install 'otwarp[haptics]' ({error})"
                ) from None
        self._hid = module

    def devices(self) -> list[HidFound]:
        """See `HidSystem`."""
        listed = sorted((_found(entry) for entry in self._hid.enumerate()), key=lambda found: found.path)
        return list({found.path: found for found in listed}.values())

    def open(self, found: HidFound) -> HidapiPort:
        """See `HidSystem`."""
        if found.path in _taken:
            raise BlockingIOError(f"{found.path} is open")
        device = self._hid.device()
        device.open_path(found.path.encode())
        device.set_nonblocking(True)
        return HidapiPort(found, device)


def _found(entry: dict[str, Any]) -> HidFound:
    """An entry of `hid.enumerate`; older versions do not say the bus, but number no interface of Bluetooth."""
    path, bus = entry["path"], entry.get("bus_type", 0)
    page, usage = entry.get("usage_page", 0), entry.get("usage", 0)
    return HidFound(
        path=path.decode(errors="replace") if isinstance(path, bytes) else str(path),
        vendor=entry["vendor_id"],
        product=entry["product_id"],
        serial=entry.get("serial_number") or "",
        name=entry.get("product_string") or "",
        usages=((page, usage),) if page else (),
        bluetooth=bus == BUS_BLUETOOTH or (not bus and entry.get("interface_number", 0) == -1),
    )
