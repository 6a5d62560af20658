"""Binary stages are first read through by a process of their own: USD may crash on a damaged one, not just refuse it.

Values in a crate file are offsets, counts and types of bytes elsewhere in it, which USD follows without looking back:
of 1000 crates with up to 16 bytes damaged, about one ends the process that reads it with SIGSEGV.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from otwarp.errors import InputError
from otwarp.scene.read.read_through import BROKEN, NO_MEMORY

MAGIC = (b"PXR-USDC", b"PK\x03\x04")
"""First bytes of crate files, and of the packages that hold them."""

States = frozenset[tuple[str, int, int]]
"""Files, when they changed [ns], and their sizes [bytes]."""

LEAST_MEMORY, MEMORY = 8 * 2**30, 32
"""Address space that reading a file may take: so many bytes, or times its size if that is more."""

LEAST_TIME, RATE = 60.0, 5e6
"""Time that reading a file may take [s], beside its size over this rate [bytes/s]."""

READER = Path(__file__).with_name("read_through.py")

_sound: dict[Path, States] = {}
"""Files that were read through well, and the layers that they were composed of."""


def check_crate(path: Path, allowed: str) -> None:
    """Refuse a file with a binary layer that USD cannot read through to its end; each is read once, until one changes.

    All layers are read: sublayers, references, payloads, value clips, of text and of binary files.

    Raises:
        InputError: One line.
    """
    whole = path.resolve()
    known = _sound.get(whole)
    if (known is not None and known == _states(file for file, *_ in known)) or not _may_be_binary(path):
        return
    problem, layers = _read_through(path)
    if problem:
        raise InputError(f"{path}: contents = USD {problem}: {allowed}, whole and valid")
    _sound[whole] = _states((str(whole), *layers))


def _states(files: Iterable[str]) -> States:
    """What tells a file from a later one of that name."""
    return frozenset((file, *_size(file)) for file in files)


def _size(file: str) -> tuple[int, int]:
    """When it changed [ns] and its size [bytes]; −1 without a file."""
    try:
        state = Path(file).stat()
    except (OSError, ValueError):
        return -1, -1
    return state.st_mtime_ns, state.st_size


def _may_be_binary(path: Path) -> bool:
    """Whether a layer of a file is binary, or cannot be excluded to be: text names others between `@`, some of them
    by expressions, by templates of clips, or to be found on a search path.
    """
    waiting, seen = [path], set()
    while waiting:
        file = waiting.pop()
        seen.add(file)
        with file.open("rb") as text:
            start = text.read(8)
            if start.startswith(MAGIC):
                return True
            if not start.startswith(b"#"):  # no layer: an array, a table, a mesh of another kind
                continue
            named = [name for line in text if b"@" in line for name in line.split(b"@")[1:-1]]
        for name in filter(None, named):
            layer = file.parent / os.fsdecode(name)
            if not os.path.isfile(layer):  # noqa: PTH113 - `Path.is_file` raises on names that are too long
                return True
            if layer not in seen:
                waiting.append(layer)
    return False


def _read_through(path: Path) -> tuple[str, list[str]]:
    """What happens to a process that reads a file through (empty: it ends well, or cannot start), and its layers."""
    size = path.stat().st_size
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
        return f"has not read it to the end after {late.timeout:.0f} s", []
    except OSError:
        return "", []
    if done.returncode == NO_MEMORY:
        return f"needs more than {most / 2**30:.0f} GiB for {size} bytes", []
    if done.returncode == BROKEN:
        return "cannot list its prims and properties", []
    if done.returncode < 0:
        return f"crashes on it ({signal.Signals(-done.returncode).name})", []
    # the C library's account of addresses beyond the file
    beyond = "reads beyond its end" if b"failed call to posix_madvise" in done.stderr else ""
    return beyond, [os.fsdecode(file) for file in done.stdout.split(b"\0") if file]
