"""What commands print: JSON for programs, tables for people."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from otwarp.errors import InputError
from otwarp.files import FULL, check_place, written

if TYPE_CHECKING:
    from rich.console import Console


def json_text(value: Any) -> str:
    """A value as JSON that people can read as well; numbers that are not finite raise `ValueError`."""
    return json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)


def write_json(value: Any, file: Path) -> None:
    """Write a value as JSON to a file, whole or not at all."""
    with written(file) as part:
        part.write_text(json_text(value) + "\n", encoding="utf-8")


def check_new(file: Path, *, force: bool) -> None:
    """Refuse to replace a file, unless `--force` asks for it, and a place where none can be written.

    Raises:
        InputError: It is there, or its folder cannot be written.
    """
    if not force and (file.exists() or file.is_symlink()):
        raise InputError(f"{file} is there already; allowed: a new file, or --force to replace it")
    check_place(file, "the file to write")


@contextmanager
def with_room(path: Path, kept: str = "") -> Iterator[None]:
    """Have a disk that is full ask for another place.

    Args:
        path: What is written; a file that the error names counts instead.
        kept: What becomes of what was there already.

    Raises:
        InputError: It is full.
    """
    try:
        yield
    except OSError as error:
        if error.errno not in FULL:
            raise
        raise InputError(f"{error.filename or path}: {error.strerror}; allowed: a disk with room{kept}") from None


def counted(number: int, one: str, several: str = "") -> str:
    """`1 solid`, `5 solids`."""
    return f"{number:,} {one if number == 1 else several or one + 's'}"


def tables_console(width: int) -> Console:
    """A console for tables; a pipe or a file, which has no width of its own, gets `width` columns, so that nothing is
    cut."""
    from rich.console import Console

    return Console(highlight=False, width=None if sys.stdout.isatty() else width)
