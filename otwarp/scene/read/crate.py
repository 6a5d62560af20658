"""Binary stages are first read through by a process of their own: USD may crash on a damaged one, not just refuse it.

Values in a crate file are offsets, counts and types of bytes elsewhere in it, which USD follows without looking back:
of 1000 crates with up to 16 bytes damaged, about one ends the process that reads it with SIGSEGV.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

from otwarp.errors import InputError
from otwarp.scene.read.read_through import BROKEN, NO_MEMORY

MAGIC = (b"PXR-USDC", b"PK\x03\x04")
"""First bytes of crate files, and of the packages that hold them."""

LEAST_MEMORY, MEMORY = 8 * 2**30, 32
"""Address space that reading a file may take: so many bytes, or times its size if that is more."""

LEAST_TIME, RATE = 60.0, 5e6
"""Time that reading a file may take [s], beside its size over this rate [bytes/s]."""

READER = Path(__file__).with_name("read_through.py")

_sound: set[tuple[str, int, int]] = set()


def check_crate(path: Path, allowed: str) -> None:
    """Refuse a binary file that USD cannot read through to its end; each file is read once, until it changes.

    Layers that it refers to are read as well. A text file that refers to a binary one is not looked at.

    Raises:
        InputError: One line.
    """
    with path.open("rb") as file:
        if not file.read(8).startswith(MAGIC):
            return
    state = path.stat()
    key = (str(path.resolve()), state.st_mtime_ns, state.st_size)
    if key in _sound:
        return
    if problem := _problem(path, state.st_size):
        raise InputError(f"{path}: contents = USD {problem}: {allowed}, whole and valid")
    _sound.add(key)


def _problem(path: Path, size: int) -> str:
    """What happens to a process that reads a file through; empty: it ends well, or could not be started."""
    most = max(LEAST_MEMORY, MEMORY * size)
    try:
        done = subprocess.run(
            [sys.executable, "-c", READER.read_text(encoding="utf-8"), str(path), str(most)],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
            timeout=LEAST_TIME + size / RATE,
        )
    except subprocess.TimeoutExpired as late:
        return f"has not read it to the end after {late.timeout:.0f} s"
    except OSError:
        return ""
    if done.returncode == NO_MEMORY:
        return f"needs more than {most / 2**30:.0f} GiB for {size} bytes"
    if done.returncode == BROKEN:
        return "cannot list its prims and properties"
    if done.returncode < 0:
        return f"crashes on it ({signal.Signals(-done.returncode).name})"
    # the C library's account of addresses beyond the file
    return "reads beyond its end" if b"failed call to posix_madvise" in done.stderr else ""
