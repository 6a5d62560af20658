"""Reads the messages of an MCAP file from its beginning, without its index: a file cut short is read up to the cut.

MCAP is an append-only container: a magic, records of (operation, length, content), chunks of records, a footer, the
magic again (https://mcap.dev/spec). Takes are not compressed, so their chunks are read in place.
"""

from __future__ import annotations

import mmap
import os
import struct
from collections.abc import Collection, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

from otwarp.errors import InputError

MAGIC = b"\x89MCAP0\r\n"
CONFIG = "/otwarp/config"
"""Topic that every take of otwarp begins with."""
SUFFIX, PART = ".mcap", ".mcap.part"
"""Of a take, and of the folder in which it is written."""
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = range(1, 7)
_RECORD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")


class Message(NamedTuple):
    """One message.

    Attributes:
        topic, kind: Of its channel; `kind` is the name of its type.
        time: When it was logged [ns since 1970].
        data: Serialized; a view into the file.
    """

    topic: str
    kind: str
    time: int
    data: memoryview


class McapFile:
    """An MCAP file that is open for reading; a context manager.

    Args:
        path: The file, or the folder `FILE.mcap.part` that a take's session left when it was killed.

    Raises:
        InputError: It cannot be read, or is no MCAP file.

    Attributes:
        complete: Whether `messages` came to the footer; False as well before it has run.
    """

    def __init__(self, path: Path | str):
        self.path, self.complete = Path(path), False
        with ExitStack() as stack:
            try:
                file = stack.enter_context(_content_of(self.path).open("rb"))
                if not os.fstat(file.fileno()).st_size:
                    raise ValueError("it is empty")  # and could not be mapped
                view = memoryview(stack.enter_context(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)))
                self._view = stack.enter_context(view)
            except (OSError, ValueError) as error:
                why = getattr(error, "strerror", None) or error
                raise InputError(f"{self.path}: cannot be read ({why}){_left_of(self.path)}") from None
            if self._view[: len(MAGIC)] != MAGIC:
                raise InputError(f"{self.path}: is no MCAP file; allowed: one that starts with its magic")
            self._closing = stack.pop_all()

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Messages in the order of the file, of some topics or of all. Ends where the file does, or makes no sense.

        Raises:
            InputError: A chunk that is compressed, or not what its checksum says.
        """
        self.complete = False
        kinds: dict[int, str] = {0: ""}
        channels: dict[int, tuple[str, str]] = {}
        try:
            for operation, content in self._all():
                if operation == _SCHEMA:
                    (number,) = struct.unpack_from("<H", content)
                    kinds[number] = _text(content, 2)[0]
                elif operation == _CHANNEL:
                    number, schema = struct.unpack_from("<2H", content)
                    channels[number] = _text(content, 4)[0], kinds[schema]
                elif operation == _MESSAGE:
                    number, _, time, _ = _MESSAGE_HEAD.unpack_from(content)
                    topic, kind = channels[number]
                    if topics is None or topic in topics:
                        yield Message(topic, kind, time, content[_MESSAGE_HEAD.size :])
                elif operation == _FOOTER:
                    self.complete = True
                    return
        except (struct.error, KeyError, UnicodeDecodeError, IndexError):
            return  # what was before makes sense by itself

    def _all(self) -> Iterator[tuple[int, memoryview]]:
        """Records of the file, and of its chunks in their places."""
        for operation, content in _records(self._view[len(MAGIC) :]):
            if operation != _CHUNK:
                yield operation, content
                continue
            _, _, size, checksum = _CHUNK_HEAD.unpack_from(content)
            compression, at = _text(content, _CHUNK_HEAD.size)
            if compression:
                raise InputError(f"{self.path}: is compressed ({compression!r}); allowed: as otwarp wrote it, without")
            inner = content[at + 8 :]
            if len(inner) != size or (checksum and crc32(inner) != checksum):
                raise InputError(f"{self.path}: has a chunk that is not what its checksum says")
            yield from _records(inner)

    def close(self) -> None:
        """Let go of the file, once no view of a message is left."""
        with suppress(BufferError):  # a view of a message lives on, and the file with it
            self._closing.close()

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def part_of(path: Path) -> Path:
    """The folder in which a take lies while it is written, and stays if its session is killed."""
    return path.with_name(path.name + ".part")


def is_take(path: Path) -> bool:
    """Whether a name is that of a take, or of the folder that a killed session leaves of one."""
    return path.name.lower().endswith((SUFFIX, PART))


def _content_of(path: Path) -> Path:
    """The file to read: in the folder of a take it has the folder's name, and `.mcap` after it."""
    if path.name.lower().endswith(PART) and path.is_dir():
        return path / (path.name + SUFFIX)
    return path


def _left_of(path: Path) -> str:
    """What to read instead of a take that is not there, if its session was killed or still runs; else ""."""
    part = part_of(path)
    if path.exists() or not is_take(part) or not part.is_dir():
        return ""
    return f"; {part} exists, left by a session that was killed or still runs: give that name to read it"


def _records(view: memoryview) -> Iterator[tuple[int, memoryview]]:
    """(operation, content) of records one after another, up to one that is cut."""
    at, end = 0, len(view)
    while at + _RECORD.size <= end:
        operation, size = _RECORD.unpack_from(view, at)
        at += _RECORD.size
        if size > end - at:
            return
        yield operation, view[at : at + size]
        if operation == _FOOTER:
            return
        at += size


def _text(content: memoryview, at: int) -> tuple[str, int]:
    """A string and where it ends."""
    (size,) = struct.unpack_from("<I", content, at)
    at += 4
    if size > len(content) - at:
        raise IndexError(size)
    return bytes(content[at : at + size]).decode(), at + size
