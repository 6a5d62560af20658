"""The functions of 3D Systems' OpenHaptics HDAPI that otwarp uses, by ctypes.

Types, constants and signatures are those of `hdDefines.h`, `hdDevice.h` and `hdScheduler.h` of OpenHaptics 3.0
(SensAble Technologies 2004), read as published with projects that build on it; later versions were not compared.
Never run against the library itself: tests load a double through `OTWARP_LIBHD`.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from typing import Any

from otwarp.errors import InputError

OVERRIDE = "OTWARP_LIBHD"
"""Environment variable with the path of the library to load instead of the installed one."""

INVALID_HANDLE = 0xFFFFFFFF
CALLBACK_CONTINUE = 1
MAX_PRIORITY = 0xFFFF
CURRENT_BUTTONS = 0x2000
CURRENT_POSITION = 0x2050
DEVICE_MODEL_TYPE = 0x2501
DEVICE_SERIAL_NUMBER = 0x2504
NOMINAL_MAX_FORCE = 0x2603
NOMINAL_MAX_CONTINUOUS_FORCE = 0x2604
CURRENT_FORCE = 0x2700
FORCE_OUTPUT = 0x4000
FORCE_ERRORS = range(0x0200, 0x0300)
"""Warm motors, too much force, too fast: the library limits or cuts the force itself, and the device stays."""
DEVICE_ALREADY_INITIATED = 0x0301

MOST_ERRORS = 32
"""Errors taken off the library's stack at a time: it must not hold the servo thread for ever."""

_WINDOWS = sys.platform == "win32"
# HDAPIENTRY and HDCALLBACK are __stdcall on Windows, which differs from the C convention in 32-bit programs only
_function: Callable[..., Any] = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE) if _WINDOWS else ctypes.CFUNCTYPE
SchedulerCallback: Any = _function(ctypes.c_uint, ctypes.c_void_p)
"""HDCallbackCode (*)(void *)."""


class ErrorInfo(ctypes.Structure):
    """HDErrorInfo: error code, the device's own code, and the device that was current."""

    _fields_ = (("code", ctypes.c_uint), ("internal", ctypes.c_int), ("handle", ctypes.c_uint))
    code: int
    internal: int
    handle: int


_DOUBLES, _INTS = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int)
_PROTOTYPES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "hdInitDevice": (ctypes.c_uint, (ctypes.c_char_p,)),
    "hdDisableDevice": (None, (ctypes.c_uint,)),
    "hdMakeCurrentDevice": (None, (ctypes.c_uint,)),
    "hdGetCurrentDevice": (ctypes.c_uint, ()),
    "hdBeginFrame": (None, (ctypes.c_uint,)),
    "hdEndFrame": (None, (ctypes.c_uint,)),
    "hdEnable": (None, (ctypes.c_uint,)),
    "hdDisable": (None, (ctypes.c_uint,)),
    "hdGetDoublev": (None, (ctypes.c_uint, _DOUBLES)),
    "hdGetIntegerv": (None, (ctypes.c_uint, _INTS)),
    "hdSetDoublev": (None, (ctypes.c_uint, _DOUBLES)),
    "hdGetString": (ctypes.c_char_p, (ctypes.c_uint,)),
    "hdGetError": (ErrorInfo, ()),
    "hdGetErrorString": (ctypes.c_char_p, (ctypes.c_uint,)),
    "hdStartScheduler": (None, ()),
    "hdStopScheduler": (None, ()),
    "hdScheduleAsynchronous": (ctypes.c_ulong, (SchedulerCallback, ctypes.c_void_p, ctypes.c_ushort)),
    "hdUnschedule": (None, (ctypes.c_ulong,)),
}


class LibHD:
    """The library, its functions with their C names and types.

    Args:
        path: Of the library, as `library_path` says.

    Raises:
        InputError: It is not there, or lacks a function.
    """

    hdInitDevice: Callable[[bytes | None], int]
    hdDisableDevice: Callable[[int], None]
    hdMakeCurrentDevice: Callable[[int], None]
    hdGetCurrentDevice: Callable[[], int]
    hdBeginFrame: Callable[[int], None]
    hdEndFrame: Callable[[int], None]
    hdEnable: Callable[[int], None]
    hdDisable: Callable[[int], None]
    hdGetDoublev: Callable[[int, Any], None]
    hdGetIntegerv: Callable[[int, Any], None]
    hdSetDoublev: Callable[[int, Any], None]
    hdGetString: Callable[[int], bytes | None]
    hdGetError: Callable[[], ErrorInfo]
    hdGetErrorString: Callable[[int], bytes | None]
    hdStartScheduler: Callable[[], None]
    hdStopScheduler: Callable[[], None]
    hdScheduleAsynchronous: Callable[[Any, int | None, int], int]
    hdUnschedule: Callable[[int], None]

    def __init__(self, path: str):
        # such a library lets other Python threads run while it is called; its scheduler thread needs that
        load = getattr(ctypes, "WinDLL", ctypes.CDLL) if _WINDOWS else ctypes.CDLL
        try:
            self.library = load(path)
            for name, (result, arguments) in _PROTOTYPES.items():
                function = getattr(self.library, name)
                function.restype, function.argtypes = result, arguments
                setattr(self, name, function)
        except (OSError, AttributeError) as error:
            raise InputError(
                f"OpenHaptics: library {path!r} cannot be used ({error}); install 3D Systems OpenHaptics and the Touch "
                f"driver, or name the library in {OVERRIDE}"
            ) from None

    def errors(self) -> list[ErrorInfo]:
        """Errors of the calling thread since last asked, newest first; empty if there are none."""
        found: list[ErrorInfo] = []
        while len(found) < MOST_ERRORS:
            error = self.hdGetError()
            if error.code == 0:
                break
            found.append(error)
        return found

    def text(self, error: ErrorInfo) -> str:
        """One line that says what an error is."""
        said = self.hdGetErrorString(error.code) or b""
        return f"{' '.join(said.decode(errors='replace').split()) or 'error'} (0x{error.code:04x})"


def library_path() -> str:
    """Path of the library to load on this system."""
    names = {"win32": "hd.dll", "cygwin": "hd.dll", "darwin": "/Library/Frameworks/HD.framework/HD"}
    return os.environ.get(OVERRIDE) or names.get(sys.platform, "libHD.so")
