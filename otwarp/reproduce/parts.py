"""The parts in which an item was computed: in which call, by which code, where, how long; kept while it is computed."""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.reproduce.code import Code
from otwarp.reproduce.item import Unavailable

PARTS = "parts.json"

EVERY = 2.0
"""Seconds after which a part's time is written anew: what a process that is killed has not told at most."""

LOAD = re.compile(r", load [\d.]+ at the start$")
"""What the line of one machine ends with, and is another for each part."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """What one call of the command did for an item.

    Attributes:
        call: When that began, UTC; the same for all that it did.
        code: Which computed.
        device: On which.
        machine: Processor, system and versions, in a line.
        seconds: Wall time.
    """

    call: str
    code: Code
    device: str
    machine: str
    seconds: float

    @classmethod
    def read(cls, said: Mapping[str, Any]) -> Part:
        """From a file.

        Raises:
            TypeError, KeyError: It does not hold one.
        """
        return cls(**{**said, "code": Code(**said["code"])})


def read_parts(file: Path) -> tuple[Part, ...]:
    """Parts of an item that is not done; none where there is no file.

    Raises:
        InputError: It is damaged.
    """
    try:
        return tuple(map(Part.read, json.loads(file.read_text(encoding="utf-8"))))
    except FileNotFoundError:
        return ()
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"{file}: contents cannot be read; allowed: what this version wrote; without {file.parent} "
                         "the item begins anew") from None  # fmt: skip


def check_code(parts: Sequence[Part], code: Code, work: Path) -> None:
    """Refuse to go on with what other code began: an item is one code's.

    Args:
        parts: So far.
        code: That would go on.
        work: Folder of what was computed so far.

    Raises:
        InputError: It was other code, or other scenes.
    """
    for part in parts:
        if part.code.digest != code.digest:
            raise InputError(f"{work}: was begun by other code or with other scenes ({part.code.said()} there, "
                             f"{code.said()} now); allowed: the same again, or without that folder, the item "
                             "anew")  # fmt: skip


@contextmanager
def timed(file: Path, before: Sequence[Part], part: Part) -> Iterator[Callable[[], tuple[Part, ...]]]:
    """Keep the parts of an item in a file while it is computed, so that a part that is killed is there, too.

    Args:
        file: Where; its folder may go in the meantime.
        before: Earlier parts.
        part: This one, whose seconds are counted from now on; it is none if the item turns out to be `Unavailable`.

    Yields:
        What tells all parts up to now.

    Raises:
        OSError: The file cannot be written at the beginning.
    """
    begun, over = time.perf_counter(), threading.Event()

    def now() -> tuple[Part, ...]:
        return (*before, replace(part, seconds=time.perf_counter() - begun))

    def write(parts: Sequence[Part]) -> None:
        with written(file) as new:
            new.write_text(json.dumps([asdict(one) for one in parts], indent=1, ensure_ascii=False) + "\n", "utf-8")

    def go_on() -> None:
        while not over.wait(EVERY):
            with suppress(OSError):  # a full disk is told by what computes
                write(now())

    write(now())
    thread = threading.Thread(target=go_on, daemon=True)
    thread.start()
    last = now
    try:
        yield now
    except Unavailable:
        last = lambda: tuple(before)  # noqa: E731
        raise
    finally:
        over.set()
        thread.join()
        with suppress(OSError):
            write(last())


def where(parts: Sequence[Part]) -> str:
    """Machine of one part; of several those they ran on, whatever the load was."""
    return parts[0].machine if len(parts) == 1 else "; ".join(by_machine(parts))


def how_long(parts: Sequence[Part]) -> str:
    """Wall time of all parts together, and of each if there are several."""
    whole = f"{sum(part.seconds for part in parts):.0f} s"
    if len(parts) == 1:
        return whole
    return f"{whole} in {len(parts)} parts ({', '.join(f'{part.seconds:.0f}' for part in parts)} s)"


def by_machine(parts: Sequence[Part]) -> dict[str, float]:
    """Machine → wall seconds of its parts, the longest first; whatever its load was."""
    found: dict[str, float] = {}
    for part in parts:
        machine = LOAD.sub("", part.machine)
        found[machine] = found.get(machine, 0.0) + part.seconds
    return dict(sorted(found.items(), key=lambda row: -row[1]))
