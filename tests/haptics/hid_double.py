"""Doubles of HID devices and of the system that lists them, and a sender that sends at once."""

from __future__ import annotations

import errno
from collections import deque

from otwarp.haptics.devices.hid import HidFound


class Port:
    """An open device of which a test says the reports, and which it unplugs."""

    def __init__(self, device: Plugged):
        self.device, self.closed = device, False
        self.features: list[tuple[int, int]] = []

    @property
    def found(self):
        return self.device.found

    def _alive(self):
        if self.closed or self.device.unplugged:
            raise OSError(errno.ENODEV, "No such device")

    def read(self):
        self._alive()
        return self.device.next()

    def write(self, report):
        self._alive()
        self.device.written.append(report)

    def feature(self, number, size):
        self._alive()
        self.features.append((number, size))
        if self.device.no_features:
            raise OSError(errno.EPIPE, "Broken pipe")
        return bytes(size)

    def close(self):
        if not self.closed:
            self.closed = True
            self.device.port = None


class Plugged:
    """A device, plugged in until `unplugged`."""

    def __init__(self, found: HidFound):
        self.found, self.unplugged, self.refuses = found, False, None
        self.reports: deque[bytes] = deque()
        self.written: list[bytes] = []
        self.no_features = False
        self.port: Port | None = None

    def next(self):
        return self.reports.popleft() if self.reports else b""


class System:
    """Lists and opens devices of which a test decides whether they are there."""

    def __init__(self, *devices: Plugged):
        self.all = list(devices)

    def devices(self):
        return [device.found for device in self.all if not device.unplugged]

    def open(self, found):
        device = next(device for device in self.all if device.found.path == found.path)
        if device.refuses is not None:
            raise device.refuses
        if device.unplugged:
            raise OSError(errno.ENOENT, "No such file or directory")
        if device.port is not None:
            raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")
        device.port = Port(device)
        return device.port


class AtOnce:
    """Sends in the caller's thread: what is sent depends on the virtual clock alone."""

    def __init__(self, send, ended):
        self._send, self._ended, self._error = send, ended, None

    def put(self, latest):
        if self._error is not None:
            raise self._error
        try:
            self._send(latest)
        except OSError as error:
            self._error = error

    def close(self, last, wait=True):
        self.put(last) if self._error is None else None
        self._ended()
