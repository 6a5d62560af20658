"""Files that appear under their name only when they are whole."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from otwarp.errors import InputError


@contextmanager
def written(path: Path, what: str = "") -> Iterator[Path]:
    """A hidden neighbour of `path` with its ending, to write: it takes the name at the end, or goes if that fails.

    Args:
        path: Where the file will be.
        what: How an error names it; empty passes an `OSError` on as it is.

    Raises:
        InputError: `what` cannot be written.
        OSError: The disk is full; it names `path`.
    """
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        yield part
        part.replace(path)
    except BaseException as error:
        part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            check_full(error, path)
            if what:
                raise InputError(f"{what} cannot be written: {error.strerror}") from error
        raise


ENOUGH = 4096
"""Bytes that a file takes at least on most disks."""


def check_place(path: Path, what: str, *, folder: bool = False) -> None:
    """Find out, by writing beside it, whether an output can be written before work is done for it; no trace is left.

    A file system may say that it can be written, as `/proc` does, and refuse.

    Args:
        path: Where it will be.
        what: How an error names it, such as `--out`.
        folder: Whether it is a folder, which is made with those above it; else a file, whose folder must be there.

    Raises:
        InputError: Something else is in its place, its folder cannot be written, or the disk is full.
    """
    try:
        with suppress(FileNotFoundError):
            path.lstat()  # a name that is too long, or below a file
        if folder:
            there = next(p for p in (path, *path.absolute().parents) if p.exists() or p.is_symlink())
        else:
            there = path.absolute().parent
            if path.exists() and not path.is_file():
                raise OSError(errno.EEXIST, "it is a folder" if path.is_dir() else "it is neither file nor folder")
        with tempfile.TemporaryFile(prefix=".otwarp-", dir=there, buffering=0) as probe:
            if probe.write(bytes(ENOUGH)) < ENOUGH:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        if folder:
            with tempfile.TemporaryDirectory(prefix=".otwarp-", dir=there):
                pass
    except (OSError, ValueError) as error:
        allowed = "a folder" if folder else "a file in a folder that is there,"
        why = getattr(error, "strerror", None) or error
        raise InputError(
            f"{what} is {path}, which cannot be written ({why}); allowed: {allowed} where files can be made"
        ) from None


def check_full(error: OSError, path: Path) -> None:
    """Raise an error of a full disk, which is no fault of the input, with the path that could not be written."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        raise OSError(error.errno, error.strerror, str(path)) from error
