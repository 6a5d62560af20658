"""A machine with HID devices of our own, for other processes too: they read where it is from the environment."""

from __future__ import annotations

import os
import tty
from pathlib import Path

from otwarp.haptics.devices.hid_ports import Hidraw
from tests.haptics.spring import SpringChain

ROOT = "OTWARP_TEST_HID"
"""Names the folder of `sys` and `dev`."""
GAMEPAD = bytes.fromhex("05 01 09 05 a1 01 c0")
"""A top-level collection Game Pad, empty."""
DUALSENSE = "0003:0000054C:00000CE6"

if ROOT in os.environ:  # in the servo's process, which imports this to unpickle its chain, before it makes the device
    Hidraw.__init__.__defaults__ = (Path(os.environ[ROOT]) / "sys", Path(os.environ[ROOT]) / "dev")
    import otwarp.haptics.devices.dualsense

    otwarp.haptics.devices.dualsense.hid_system = Hidraw


class MachineChain(SpringChain):
    """A chain of this module."""


def plug_dualsense(root: Path) -> int:
    """A DualSense by USB; what is read from this pseudo-terminal was written to it. Its other end stays open here."""
    home = root / "sys" / "hidraw0" / "device"
    home.mkdir(parents=True)
    (root / "dev").mkdir()
    (home / "uevent").write_text(f"HID_ID={DUALSENSE}\nHID_NAME=Wireless Controller\n")
    (home / "report_descriptor").write_bytes(GAMEPAD)
    master, slave = os.openpty()
    tty.setraw(slave)
    (root / "dev" / "hidraw0").symlink_to(os.ttyname(slave))
    return master
