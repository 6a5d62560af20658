"""The double of OpenHaptics' library: compiled from `libhd_double.c`, with the controls that only a double has."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import pytest

from otwarp.haptics.core import Vec3

SOURCE = Path(__file__).with_name("libhd_double.c")


def compiled(folder: Path) -> str:
    """Path of the library, made in a folder by the system's C compiler; without one the test is skipped."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler (cc) to make the double of libHD with")
    path = folder / "libhd_double.so"
    options = ["-O1", "-Wall", "-Werror", "-shared", "-fPIC", "-pthread"]
    subprocess.run([compiler, *options, str(SOURCE), "-o", str(path), "-lm"], check=True)
    return str(path)


class Double:
    """The double's own controls; devices are numbered as they were added."""

    def __init__(self, path: str):
        self.library = ctypes.CDLL(path)
        self.library.double_add.argtypes = (ctypes.c_char_p, ctypes.c_char_p, ctypes.c_double, ctypes.c_double)
        self.library.double_move.argtypes = (ctypes.c_int, *[ctypes.c_double] * 3, ctypes.c_int)
        self.library.double_peak.restype = ctypes.c_double

    def __getattr__(self, name: str):
        return getattr(self.library, f"double_{name}")

    def add(self, name: str, serial: str = "1", force: float = 3.3, continuous: float = 0.88) -> int:
        return self.library.double_add(name.encode(), serial.encode(), force, continuous)

    def force(self, device: int) -> Vec3:
        out = (ctypes.c_double * 3)()
        self.library.double_force(device, out)
        return (out[0], out[1], out[2])

    def told(self, device: int) -> Vec3:
        out = (ctypes.c_double * 3)()
        self.library.double_told(device, out)
        return (out[0], out[1], out[2])

    def tick(self) -> None:
        assert self.wait(2) == 1, "the scheduler does not run"
