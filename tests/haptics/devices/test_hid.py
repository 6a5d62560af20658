"""HID devices by hidraw, on a made sysfs and pseudo-terminals in place of nodes, and by hidapi, on a double of it."""

from __future__ import annotations

import os
import sys
import tty

import pytest
from hypothesis import given
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.core import DeviceLost
from otwarp.haptics.devices import hid_ports, parse_devices
from otwarp.haptics.devices.hid import HidFound
from otwarp.haptics.devices.hid_ports import Hidapi
from otwarp.haptics.devices.spacemouse import create, find_devices

NAVIGATOR = bytes.fromhex("05 01 09 08 a1 01 a1 00 85 01 16 a2 fe 26 5e 01 36 88 fa 46 78 05 55 0c 65 11 09 30 09 31")
"""The beginning of a SpaceNavigator's report descriptor, from AndunHH/spacemouse, SpaceNavigator.md."""

linux = pytest.mark.skipif(sys.platform != "linux", reason="hidraw is Linux's")


class Machine:
    """A sysfs and a /dev of our own."""

    def __init__(self, root):
        from otwarp.haptics.devices.hid_ports import Hidraw

        self.sysfs, self.dev = root / "sys", root / "dev"
        self.sysfs.mkdir()
        self.dev.mkdir()
        self.system = Hidraw(self.sysfs, self.dev)
        self.masters = {}

    def plug(self, number, identity="0003:0000256F:0000C635", descriptor=NAVIGATOR, **more):
        """A node, whose other end is ours."""
        home = self.sysfs / f"hidraw{number}" / "device"
        home.mkdir(parents=True)
        lines = {"DRIVER": "hid-generic", "HID_ID": identity, "HID_NAME": "3Dconnexion X=1"} | more
        (home / "uevent").write_text("".join(f"{k}={v}\n" for k, v in lines.items()))
        (home / "report_descriptor").write_bytes(descriptor)
        master, slave = os.openpty()
        tty.setraw(slave)
        (self.dev / f"hidraw{number}").symlink_to(os.ttyname(slave))
        os.close(slave)
        self.masters[number] = master
        return master

    def close(self):
        for master in self.masters.values():
            os.close(master)


@pytest.fixture
def machine(tmp_path):
    machine = Machine(tmp_path)
    yield machine
    machine.close()


@linux
def test_sysfs_says_what_is_there(machine):
    machine.plug(10, HID_PHYS="usb-1/input0", HID_UNIQ="AB")
    machine.plug(9, "0005:0000054C:00000CE6", bytes.fromhex("05 01 09 05 a1 01"), HID_UNIQ="aa:bb")
    machine.plug(2, "nonsense")
    (machine.sysfs / "hidraw3").mkdir()
    first, second = machine.system.devices()
    assert (first.path, first.vendor, first.product) == (str(machine.dev / "hidraw9"), 0x054C, 0x0CE6)
    assert (first.bluetooth, first.serial, first.usages) == (True, "aa:bb", ((1, 5),))
    assert (second.bluetooth, second.place, second.name) == (False, "usb-1/input0", "3Dconnexion X=1")
    assert (second.usages, second.allowed) == (((1, 8),), True)


@linux
def test_a_node_is_read_without_waiting_held_by_one_hand_and_gone_when_unplugged(machine):
    master = machine.plug(0)
    first, second = (create(spec, machine.system) for spec in parse_devices(["spacemouse:#1", "spacemouse:#1,speed=1"]))
    first.open()
    with pytest.raises(InputError, match="in use already"):
        second.open()
    assert first.read(0.0).buttons == 0
    os.write(master, bytes([3, 2, 0]))
    assert first.read(0.001).buttons == 2
    first.close()
    second.open()
    os.close(machine.masters.pop(0))
    with pytest.raises(DeviceLost):
        second.read(0.0)
    with pytest.raises(InputError):
        second.open()


@linux
def test_a_node_takes_reports_until_it_is_closed(machine):
    master = machine.plug(0)
    port = machine.system.open(machine.system.devices()[0])
    port.write(b"\x02abc")
    assert os.read(master, 100) == b"\x02abc"
    port.close()
    port.close()
    for use in (port.read, lambda: port.write(b"x"), lambda: port.feature(5, 41)):
        with pytest.raises(OSError, match="closed"):
            use()


@linux
def test_a_node_that_may_not_be_opened_is_told_apart(machine, monkeypatch):
    machine.plug(0)

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("otwarp.haptics.devices.hid_ports.os.open", refuse)
    monkeypatch.setattr("otwarp.haptics.devices.hid_ports.os.access", lambda *_: False)
    with pytest.raises(InputError, match="udev rule"):
        create(parse_devices(["spacemouse"])[0], machine.system).open()
    (line,) = find_devices(machine.system)
    assert 'KERNELS=="*:256F:C635.*"' in line


@linux
def test_a_feature_is_asked_for_by_the_kernels_number(machine, monkeypatch):
    machine.plug(0)
    port = machine.system.open(machine.system.devices()[0])
    asked = []

    def ioctl(fd, request, answer):
        asked.append((request, answer[0], len(answer)))
        answer[1] = 7
        return 2

    monkeypatch.setattr("fcntl.ioctl", ioctl)
    assert port.feature(5, 41) == b"\x05\x07"
    # _IOC(_IOC_WRITE | _IOC_READ, 'H', 0x07, 41)
    assert asked == [((2 | 1) << 30 | 41 << 16 | ord("H") << 8 | 7, 5, 41)]
    port.close()


@linux
@given(descriptor=st.binary(max_size=60))
def test_no_descriptor_raises(descriptor):
    from otwarp.haptics.devices.hid_ports import top_usages

    assert all(0 <= page < 1 << 16 and 0 <= usage < 1 << 16 for page, usage in top_usages(descriptor))


@linux
def test_every_top_level_collection_of_a_descriptor_counts():
    from otwarp.haptics.devices.hid_ports import top_usages

    keyboard = bytes.fromhex("05 01 09 06 a1 01 05 07 19 e0 81 02 c0")
    vendor = bytes.fromhex("06 00 ff 09 01 a1 01 09 20 a1 02 c0 c0")
    extended = bytes.fromhex("0b 08 00 01 00 a1 01 c0")
    assert list(top_usages(keyboard + vendor + extended)) == [(1, 6), (0xFF00, 1), (1, 8)]


# hidapi


class Handle:
    def __init__(self, module):
        self.module, self.nonblocking, self.closed = module, False, False

    def open_path(self, path):
        if path not in self.module.openable:
            raise OSError("open failed")

    def set_nonblocking(self, on):
        self.nonblocking = bool(on)

    def read(self, size):
        if self.module.gone:
            raise OSError("read error")
        assert self.nonblocking
        return self.module.reports.pop(0) if self.module.reports else []

    def write(self, report):
        return -1 if self.module.gone else len(report)

    def get_feature_report(self, number, size):
        return [number, 1, 2][:size]

    def close(self):
        self.closed = True


class Module:
    """A double of hidapi's module `hid`."""

    def __init__(self):
        entry = {"vendor_id": 0x256F, "product_id": 0xC635, "serial_number": None, "product_string": "SpaceMouse"}
        bus = {"usage_page": 1, "usage": 8, "interface_number": 0, "bus_type": 1}
        old = {"usage_page": 0, "usage": 0, "interface_number": -1}
        self.entries = [entry | bus | {"path": b"b"}, entry | old | {"path": b"a", "serial_number": "S"}]
        self.openable, self.reports, self.gone = {b"a", b"b"}, [], False

    def enumerate(self):
        return self.entries

    def device(self):
        return Handle(self)


def test_hidapi_lists_reads_writes_and_loses():
    module = Module()
    system = Hidapi(module)
    found = system.devices()
    assert [f.path for f in found] == ["a", "b"]
    assert [f.bluetooth for f in found] == [True, False]
    assert [f.usages for f in found] == [(), ((1, 8),)]
    first, second = (create(spec, system) for spec in parse_devices(["spacemouse:S", "spacemouse:#1"]))
    first.open()
    with pytest.raises(InputError, match="in use already"):
        second.open()
    module.reports.append([3, 1, 0])
    assert first.read(0.0).buttons == 1
    module.gone = True
    with pytest.raises(DeviceLost, match="read error"):
        first.read(0.001)
    assert hid_ports._taken == set()
    module.openable.clear()
    with pytest.raises(InputError, match="cannot be opened"):
        second.open()


def test_hidapi_ports_say_when_they_are_gone_or_closed():
    module = Module()
    port = Hidapi(module).open(HidFound(path="a", vendor=1, product=2))
    assert port.feature(5, 2) == b"\x05\x01"
    port.write(b"\x02")
    module.gone = True
    with pytest.raises(OSError, match="write failed"):
        port.write(b"\x02")
    port.close()
    port.close()
    with pytest.raises(OSError, match="closed"):
        port.read()


def test_the_absent_package_is_one_line_that_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "hid", None)
    with pytest.raises(InputError, match=r"otwarp\[haptics\]") as caught:
        Hidapi()
    assert "\n" not in str(caught.value)


def test_this_machine_can_be_asked_what_is_plugged_in():
    lines = find_devices()
    assert all(line.startswith("spacemouse:") for line in lines)
