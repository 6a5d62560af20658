"""The library of OpenHaptics: its name, its absence, and the end of a program that has it open."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from otwarp.errors import InputError
from otwarp.haptics.devices import openhaptics
from otwarp.haptics.devices.libhd import OVERRIDE, library_path
from otwarp.haptics.devices.openhaptics import OpenHapticsDevice


@pytest.mark.parametrize("bad", ["/nowhere/libHD.so", "libc.so.6"])
def test_without_the_library_there_is_one_clear_line(monkeypatch, bad):
    monkeypatch.setenv(OVERRIDE, bad)
    for call in (OpenHapticsDevice(None).open, openhaptics.find_devices):
        with pytest.raises(InputError, match=r"install 3D Systems OpenHaptics .* OTWARP_LIBHD") as error:
            call()
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(("system", "name"), [("linux", "libHD.so"), ("win32", "hd.dll"), ("darwin", "HD.framework")])
def test_the_library_has_the_name_of_the_system(monkeypatch, system, name):
    monkeypatch.delenv(OVERRIDE, raising=False)
    monkeypatch.setattr(sys, "platform", system)
    assert name in library_path()


def test_an_interpreter_that_ends_with_a_device_open_ends_well(library):
    program = (
        "import ctypes, os\n"
        "from otwarp.haptics.devices.openhaptics import OpenHapticsDevice\n"
        f"double = ctypes.CDLL({library!r})\n"
        "double.double_add.argtypes = (ctypes.c_char_p, ctypes.c_char_p, ctypes.c_double, ctypes.c_double)\n"
        "double.double_add(b'it', b'1', 1.0, 1.0)\n"
        "device = OpenHapticsDevice('it')\n"
        "device.open()\n"
        "device.write((1.0, 0.0, 0.0))\n"
        "double.double_wait(3)\n"
        "import atexit\n"
        "print('numpy' in __import__('sys').modules, double.double_running())\n"
    )
    environment = {**os.environ, OVERRIDE: library}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == ["False", "1"]
