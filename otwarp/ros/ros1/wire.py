"""Bytes of TCPROS: connection headers and length-prefixed messages, with a cap on both.

A connection header is a little-endian uint32 of its length, then fields, each a uint32 of its length and `name=value`.
After it, a message is a uint32 of its length and its body. Source: the ROS wiki, `ROS/Connection Header` and
`ROS/TCPROS`.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Mapping

LENGTH = 4
"""Bytes of a length."""
MOST_HEADER = 1 << 18
"""Largest connection header that is accepted [bytes]; the largest of our message definitions takes 4 kB."""
MOST_FIELDS = 64
"""Most fields of a connection header; TCPROS names nine."""
MOST_MESSAGE = 1 << 20
"""Largest message body that is accepted unless a node says otherwise [bytes]; a pose takes 90."""
CHUNK = 1 << 12
"""Bytes asked of a socket at a time while a header is awaited."""


class Malformed(Exception):
    """Bytes of a peer that are not what TCPROS says; the connection ends, and the text says why in one line."""


def packed(body: bytes | memoryview) -> bytes:
    """A body with its length in front."""
    return len(body).to_bytes(LENGTH, "little") + body


def encode_header(fields: Mapping[str, str]) -> bytes:
    """A connection header with its length in front.

    Args:
        fields: Names without `=`, and values.
    """
    return packed(b"".join(packed(f"{name}={value}".encode()) for name, value in fields.items()))


def decode_header(body: bytes) -> dict[str, str]:
    """Fields of a connection header without the length in front.

    Raises:
        Malformed: Lengths that do not add up, a field without `=` or name, a name twice, no UTF-8, too many fields.
    """
    fields: dict[str, str] = {}
    at = 0
    while at < len(body):
        if len(body) - at < LENGTH:
            raise Malformed(f"header ends within a field's length, {len(body) - at} bytes left")
        size = int.from_bytes(body[at : at + LENGTH], "little")
        at += LENGTH
        if size > len(body) - at:
            raise Malformed(f"header has a field of {size} bytes where {len(body) - at} are left")
        try:
            name, equals, value = body[at : at + size].decode().partition("=")
        except UnicodeDecodeError:
            raise Malformed("header has a field that is not UTF-8") from None
        if not equals or not name:
            raise Malformed(f"header has the field {name[:40]!r} without a name or '='")
        if name in fields or len(fields) >= MOST_FIELDS:
            raise Malformed(f"header has the field {name[:40]!r} twice, or more than {MOST_FIELDS} fields")
        fields[name] = value
        at += size
    return fields


class Frames:
    """Cuts a stream into its length-prefixed bodies; holds no more than one incomplete body and the newest chunk.

    Args:
        most: Largest body [bytes].
        what: `header` or `message`, for complaints.
    """

    __slots__ = ("_buffer", "_most", "_what")

    def __init__(self, most: int = MOST_MESSAGE, what: str = "message") -> None:
        self._buffer = bytearray()
        self._most, self._what = most, what

    @property
    def rest(self) -> bytes:
        """Bytes that came after the last whole body."""
        return bytes(self._buffer)

    def feed(self, chunk: bytes, most: int | None = None) -> list[bytes]:
        """Take what a socket gave; the bodies that are now whole.

        Args:
            chunk: What came.
            most: Cut off no more than that many bodies, and leave the others in `rest`.

        Raises:
            Malformed: A length above the cap; nothing is allocated for it.
        """
        buffer = self._buffer
        buffer += chunk
        bodies: list[bytes] = []
        at = 0
        while len(buffer) - at >= LENGTH and len(bodies) != most:
            size = int.from_bytes(buffer[at : at + LENGTH], "little")
            if size > self._most:
                raise Malformed(f"{self._what} of {size} bytes, at most {self._most} are accepted")
            end = at + LENGTH + size
            if end > len(buffer):
                break
            bodies.append(bytes(buffer[at + LENGTH : end]))
            at = end
        del buffer[:at]
        return bodies


def receive_header(sock: socket.socket, timeout: float) -> tuple[bytes, bytes]:
    """(connection header without its length, bytes that came after it).

    Raises:
        Malformed: Too long, or the peer hung up within it.
        OSError: It took longer than `timeout` [s], or the connection broke.
    """
    frames, deadline = Frames(MOST_HEADER, "header"), time.monotonic() + timeout
    while True:
        rest = deadline - time.monotonic()
        if rest <= 0.0:
            raise TimeoutError("no header in time")
        sock.settimeout(rest)
        chunk = sock.recv(CHUNK)
        if not chunk:
            raise Malformed("connection ended before its header")
        for header in frames.feed(chunk, most=1):
            return header, frames.rest
