"""Files and folders that appear under their name only when they are whole, and folders that one process works in."""

from __future__ import annotations

import errno
import io
import os
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

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


def save_picture(figure: Any, file: Path, dpi: int = 160) -> None:
    """Write a figure of matplotlib, PNG, SVG or PDF by its ending, which is drawn before the file is opened.

    On a full disk Matplotlib's own writer of PDF fails again while it closes the file.

    Raises:
        OSError: The disk is full; it names `file`.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=dpi, format=file.suffix[1:])
    with written(file) as part:
        part.write_bytes(drawn.getbuffer())


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
            for left in there.glob(".otwarp-????????"):
                with suppress(OSError):
                    left.rmdir()  # of a process that was killed here; only what is empty goes
            with tempfile.TemporaryDirectory(prefix=".otwarp-", dir=there):
                pass
    except (OSError, ValueError) as error:
        allowed = "a folder" if folder else "a file in a folder that is there,"
        why = getattr(error, "strerror", None) or error
        raise InputError(
            f"{what} is {path}, which cannot be written ({why}); allowed: {allowed} where files can be made"
        ) from None


FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What systems say of a disk, a quota or a file that is full."""


def check_full(error: OSError, path: Path) -> None:
    """Raise an error of a full disk, which is no fault of the input, with the path that could not be written."""
    if error.errno in FULL:
        raise OSError(error.errno, error.strerror, str(path)) from error


@contextmanager
def made_apart(folder: Path, whole: str) -> Iterator[Path]:
    """A hidden neighbour that becomes the folder in one move, unless somebody else's has become it in the meantime.

    Args:
        folder: Where; there may be an empty one.
        whole: A file in it that says that somebody has made it.

    Raises:
        InputError: The folder is there and cannot be replaced by another one.
        OSError: The disk is full; nothing stays.
    """
    folder = folder.absolute()
    folder.parent.mkdir(parents=True, exist_ok=True)
    _remove_remains(folder)
    name = f".{folder.name}.part-{socket.gethostname()}-{os.getpid()}-"
    apart = Path(tempfile.mkdtemp(prefix=name, dir=folder.parent))
    try:
        apart.chmod(0o777 & ~_mask())  # a folder of one's own group's, perhaps: as mkdir makes it
        yield apart
        if os.name == "nt" and folder.is_dir():
            folder.rmdir()
        apart.rename(folder)
    except OSError as error:
        if (folder / whole).exists():
            return
        if error.filename is None or Path(str(error.filename)).is_relative_to(apart):
            check_full(error, folder)  # else another file was written meanwhile, and the error names it
        if error.filename2 is None:  # while it was made
            raise
        raise InputError(
            f"--out is {folder}, which is there and cannot be replaced ({error.strerror}); allowed: a new folder"
        ) from None
    finally:
        shutil.rmtree(apart, ignore_errors=True)


@contextmanager
def written_together(folder: Path) -> Iterator[Path]:
    """A hidden folder for some files of a folder: all of them get there at the end, or none if one cannot be written.

    Args:
        folder: Where; it is made, and goes again if it was and nothing gets there.

    Raises:
        OSError: The disk is full, or a folder has the name of a file; it names that of `folder`.
    """
    new = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    remains = folder / "files"
    _remove_remains(remains)
    apart = Path(tempfile.mkdtemp(prefix=f".{remains.name}.part-{socket.gethostname()}-{os.getpid()}-", dir=folder))
    try:
        yield apart
        files = sorted(apart.iterdir())
        for there in (folder / file.name for file in files):
            if there.is_dir():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(there))
        for file in files:
            file.replace(folder / file.name)
        new = False
    except OSError as error:
        if error.filename is not None and Path(str(error.filename)).is_relative_to(apart):
            check_full(error, folder / Path(str(error.filename)).name)
        raise
    finally:
        shutil.rmtree(apart, ignore_errors=True)
        if new:
            with suppress(OSError):
                folder.rmdir()


def _mask() -> int:
    """Permissions that new files lack; only setting it tells."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def _remove_remains(folder: Path) -> None:
    """Remove what processes of this machine left beside a folder that were killed while they made it."""
    for part in folder.parent.glob(f".{folder.name}.part-{socket.gethostname()}-*"):
        try:
            os.kill(int(part.name.split("-")[-2]), 0)
        except ProcessLookupError:
            shutil.rmtree(part, ignore_errors=True)
        except (OSError, ValueError):
            pass


@contextmanager
def claimed(folder: Path, doing: str) -> Iterator[None]:
    """Hold a folder against a second process of this machine that would work in it.

    Args:
        folder: Which is there.
        doing: What another process does, and what is allowed, for the message.

    Raises:
        InputError: Another process has it.
    """
    file = os.open(folder / "driver.lock", os.O_RDWR | os.O_CREAT, 0o664)
    try:
        _lock(file, folder, doing)
        yield
    finally:
        os.close(file)


def _lock(file: int, folder: Path, doing: str) -> None:
    """Lock a file for as long as it is open, where the system can."""
    try:
        import fcntl
    except ImportError:  # Windows has no such locks; there two drivers compute the same twice
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"{folder}: another process {doing}") from None
    except OSError:  # file systems without locks: two drivers compute the same twice, to the same bits
        return
