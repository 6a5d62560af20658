"""Files that appear under their name only when they are whole."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
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


def check_full(error: OSError, path: Path) -> None:
    """Raise an error of a full disk, which is no fault of the input, with the path that could not be written."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        raise OSError(error.errno, error.strerror, str(path)) from error
