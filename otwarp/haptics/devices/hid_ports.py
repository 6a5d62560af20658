"""HID devices as the system has them: Linux's `/dev/hidraw*`, read without any package, or the package `hidapi`.

hidapi's Linux wheel is not used where hidraw is there: its module `hid` is built on libusb, takes the device away from
the kernel's own driver, and sees nothing that is connected by Bluetooth (trezor/cython-hidapi issues 110, 203;
libusb/hidapi README). On Windows and macOS it never ran: it is written from the package's documentation and tested
against a double of its module `hid`.

A node of hidraw keeps up to 64 reports until they are read (Linux, drivers/hid/hidraw.c). Writing by USB waits for the
transfer, up to 5 s if the device hangs (usbhid_output_report in drivers/hid/usbhid/hid-core.c), so a control loop must
not write itself.
"""

from __future__ import annotations

import errno
import json
import os
import sys
from collections.abc import Iterator
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.devices.hid import HidFound, HidPort, HidSystem

SYSFS = Path("/sys/class/hidraw")
LONGEST = 4096
"""Bytes of the longest report that is taken whole (HID_MAX_BUFFER_SIZE was 4096 until Linux 5.x; ours have 78)."""
BUS_BLUETOOTH = 0x05
"""linux/input.h."""
HIDAPI_BUS_BLUETOOTH = 2
"""HID_API_BUS_BLUETOOTH of hidapi.h, since 0.13."""
GET_FEATURE = 0xC0004807
"""HIDIOCGFEATURE(0) of linux/hidraw.h: read and write, group 'H', number 7; the size goes to bits 16 to 29."""

_taken: set[str] = set()
"""Paths that are open by hidapi in this process: it would open one twice."""


def hid_system() -> HidSystem:
    """That of this machine.

    Raises:
        InputError: The package is needed and absent.
    """
    if sys.platform == "linux" and SYSFS.is_dir():
        return Hidraw()
    return Hidapi()


def address_of(found: HidFound) -> str:
    """A device as text, for another process."""
    return json.dumps(asdict(found))


def found_at(address: str) -> HidFound:
    """The device that `address_of` wrote as text; for the guardian, in a process of its own."""
    fields = json.loads(address)
    return HidFound(**fields | {"usages": tuple(tuple(usage) for usage in fields["usages"])})


def open_beside(found: HidFound) -> HidPort:
    """Open a device that another process may hold.

    Raises:
        OSError: It cannot be opened.
    """
    if found.path.startswith("/"):  # a node of hidraw; hidapi's paths are no files
        return HidrawPort(found, alone=False)
    return Hidapi().open(found)


class HidrawPort:
    """An open node.

    Args:
        found: What it is.
        alone: Whether to hold it, so that no other side may.

    Raises:
        PermissionError: This user may not.
        BlockingIOError: Another side holds it.
        OSError: It is gone.
    """

    def __init__(self, found: HidFound, alone: bool = True):
        import fcntl  # of POSIX systems alone

        self._found = found
        self._fd = os.open(found.path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            # of the open file, not of the process: two hands in one servo exclude each other too
            if alone:
                fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._fd)
            raise

    @property
    def found(self) -> HidFound:
        """See `HidPort`."""
        return self._found

    def read(self) -> bytes:
        """See `HidPort`."""
        try:
            report = os.read(self._open_fd(), LONGEST)
        except BlockingIOError:
            return b""
        if not report:  # the end of a file; hidraw itself says EIO
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
        return report

    def write(self, report: bytes) -> None:
        """See `HidPort`."""
        os.write(self._open_fd(), report)

    def feature(self, number: int, size: int) -> bytes:
        """See `HidPort`."""
        import fcntl

        answer = bytearray(size)
        answer[0] = number
        got = fcntl.ioctl(self._open_fd(), GET_FEATURE | size << 16, answer)
        return bytes(answer[:got])

    def close(self) -> None:
        """See `HidPort`."""
        fd, self._fd = self._fd, -1
        if fd >= 0:
            os.close(fd)

    def _open_fd(self) -> int:
        if self._fd < 0:
            raise OSError(errno.EBADF, "closed")
        return self._fd


class Hidraw:
    """What Linux lists.

    Args:
        sysfs: `/sys/class/hidraw`.
        dev: `/dev`.
    """

    def __init__(self, sysfs: Path = SYSFS, dev: Path = Path("/dev")):
        self._sysfs, self._dev = sysfs, dev

    def devices(self) -> list[HidFound]:
        """See `HidSystem`; by number, and without those that vanish meanwhile."""
        nodes = [node for node in self._sysfs.glob("hidraw*") if node.name[6:].isdigit()]
        return [found for node in sorted(nodes, key=lambda n: int(n.name[6:])) if (found := self._found(node))]

    def _found(self, node: Path) -> HidFound | None:
        try:
            lines = (node / "device" / "uevent").read_text(encoding="utf-8", errors="replace").splitlines()
            descriptor = (node / "device" / "report_descriptor").read_bytes()
        except OSError:
            return None
        said = dict(line.split("=", 1) for line in lines if "=" in line)
        try:
            bus, vendor, product = (int(part, 16) for part in said["HID_ID"].split(":"))
        except (KeyError, ValueError):
            return None
        path = self._dev / node.name
        return HidFound(
            path=str(path),
            vendor=vendor,
            product=product,
            serial=said.get("HID_UNIQ", ""),
            place=said.get("HID_PHYS", ""),
            name=said.get("HID_NAME", ""),
            usages=tuple(top_usages(descriptor)),
            bluetooth=bus == BUS_BLUETOOTH,
            allowed=os.access(path, os.R_OK | os.W_OK),
        )

    def open(self, found: HidFound) -> HidrawPort:
        """See `HidSystem`."""
        return HidrawPort(found)


def top_usages(descriptor: bytes) -> Iterator[tuple[int, int]]:
    """(page, usage) of each top-level collection of a report descriptor; ends where the descriptor is malformed.

    Source: USB Device Class Definition for HID 1.11, §6.2.2.2: the first byte of an item holds its size in bits 0–1,
    its type in 2–3, its tag in 4–7.
    """
    at, depth, page, usage = 0, 0, 0, 0
    while at < len(descriptor):
        item = descriptor[at]
        if item == 0xFE:  # a long item: its size follows
            at += 3 + (descriptor[at + 1] if at + 1 < len(descriptor) else 0)
            continue
        size = (0, 1, 2, 4)[item & 0x03]
        value = int.from_bytes(descriptor[at + 1 : at + 1 + size], "little")
        at += 1 + size
        kind = item & 0xFC
        if kind == 0x04:
            page = value & 0xFFFF
        elif kind == 0x08:
            # four bytes bring their own page
            usage = value if size == 4 else page << 16 | value
        elif kind == 0xA0:
            if depth == 0:
                yield usage >> 16, usage & 0xFFFF
            depth += 1
        elif kind == 0xC0:
            depth -= 1
        if kind in (0x80, 0x90, 0xA0, 0xB0, 0xC0):  # main items use up the usage
            usage = 0


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
        listed = sorted((_listed(entry) for entry in self._hid.enumerate()), key=lambda found: found.path)
        return list({found.path: found for found in listed}.values())

    def open(self, found: HidFound) -> HidapiPort:
        """See `HidSystem`."""
        if found.path in _taken:
            raise BlockingIOError(f"{found.path} is open")
        device = self._hid.device()
        device.open_path(found.path.encode())
        device.set_nonblocking(True)
        return HidapiPort(found, device)


def _listed(entry: dict[str, Any]) -> HidFound:
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
        bluetooth=bus == HIDAPI_BUS_BLUETOOTH or (not bus and entry.get("interface_number", 0) == -1),
    )
