"""Recordings on disk: messages of an MCAP file, and their bytes by CDR (OMG XCDR1, little-endian).

MCAP is an append-only container: a magic, records of (operation, length, content), chunks of records, a footer, the
magic again (https://mcap.dev/spec). `McapFile` reads it from its beginning, without its index: a file cut short is read
up to the cut. Recordings are not compressed, so their chunks are read in place.

The exact data are ROS 2 messages made of 8-byte numbers, so that a batch of the servo's cycles is written as it lay in
its ring, and floats come back bit for bit.
"""

from __future__ import annotations

import mmap
import os
import struct
from array import array
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

from otwarp.errors import InputError
from otwarp.haptics.core import CYCLE, SceneFrame, SphereFrame, TrapFrame

MAGIC = b"\x89MCAP0\r\n"
CONFIG = "/otwarp/config"
"""Topic that every recording of otwarp begins with."""
SCENE, COMMANDS, PACE, SCHEMAS, END = (f"/otwarp/{name}" for name in ("scene", "commands", "pace", "schemas", "end"))
CYCLES, START = "/otwarp/cycles/", "/otwarp/start/"
"""Followed by the name of the hand."""
PERCEPTION, CAMERA = "/otwarp/perception", "/camera/"
"""What a camera said in a turn of the loop; its images, followed by whose they are."""
SUFFIX, PART = ".mcap", ".mcap.part"
"""Of a recording, and of the folder in which it is written."""
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = range(1, 7)
_RECORD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")

CYCLES_TYPE, SCENE_TYPE = "otwarp_msgs/msg/ServoCycles", "otwarp_msgs/msg/SceneNow"

DEFINITIONS = {
    "otwarp_msgs/msg/ServoCycle": """# One cycle of one hand, see Cycle of otwarp.haptics
uint64 tick
float64 time  # servo's clock [s]
float64 sample_time
geometry_msgs/Point position  # hand, device frame [m]
uint64 buttons
uint64 flags
uint64 beat
uint64 actions
float64 motion_gain  # [um/m], nan: as configured
float64 force_gain  # [N/pN], nan: as configured
float64 force_limit  # of the device [N]
float64 continuous_force
geometry_msgs/Vector3 force  # sent [N]
geometry_msgs/Vector3 asked  # of safety [N]
float64 energy  # [J]
uint64 state
geometry_msgs/Vector3 moved  # traps, from where the hand took hold [um]
""",
    CYCLES_TYPE: """# Consecutive cycles of one hand
string hand
uint64 lost  # so far
otwarp_msgs/ServoCycle[] cycles
""",
    SCENE_TYPE: """# A state that the simulation published to the servo
uint64 beat
float64 time  # simulated [s]
float64 contact_force  # largest [pN]
int64[] trap_index
float64[] trap_position  # x, y, z of each [um]
float64[] trap_power  # [mW]
int64[] sphere_body
float64[] sphere_position  # x, y, z of each [um]
""",
}
"""Type → text of its definition."""

HEAD = b"\x00\x01\x00\x00"
"""CDR, little-endian; what follows is aligned from its own beginning."""
_ENTRY = struct.Struct("<Q2d")


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
        path: The file, or the folder `FILE.mcap.part` that a session left when it was killed.

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
    """The folder in which a recording lies while it is written, and stays if its session is killed."""
    return path.with_name(path.name + ".part")


def is_recording(path: Path) -> bool:
    """Whether a name is that of a recording, or of the folder that a killed session leaves of one."""
    return path.name.lower().endswith((SUFFIX, PART))


def _content_of(path: Path) -> Path:
    """The file to read: in the folder of a recording it has the folder's name, and `.mcap` after it."""
    if path.name.lower().endswith(PART) and path.is_dir():
        return path / (path.name + SUFFIX)
    return path


def _left_of(path: Path) -> str:
    """What to read instead of a recording that is not there, if its session was killed or still runs; else ""."""
    part = part_of(path)
    if path.exists() or not is_recording(part) or not part.is_dir():
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


def pack_cycles(hand: str, lost: int, records: bytes) -> bytes:
    """`ServoCycles` of records as they come from a ring."""
    name = hand.encode() + b"\0"
    body = struct.pack("<I", len(name)) + name
    body += bytes(-len(body) % 8) + struct.pack("<QI", lost, len(records) // CYCLE.size)
    if records:
        body += bytes(-len(body) % 8)
    return HEAD + body + records


def unpack_cycles(data: bytes | memoryview) -> tuple[str, int, bytes]:
    """(hand, lost, records) of `ServoCycles`.

    Raises:
        InputError: It is none.
    """
    try:
        body = _body(data)
        (size,) = struct.unpack_from("<I", body)
        hand = bytes(body[4 : 4 + size]).rstrip(b"\0").decode()
        at = _aligned(4 + size)
        lost, count = struct.unpack_from("<QI", body, at)
        at = _aligned(at + 12) if count else at + 12
        records = bytes(body[at:])
        # serializers may pad the end
        if not count * CYCLE.size <= len(records) < count * CYCLE.size + 8:
            raise ValueError(f"{count} cycles in {len(records)} bytes")
    except (struct.error, ValueError) as error:
        raise InputError(f"message {CYCLES_TYPE}: cannot be read ({error})") from None
    return hand, lost, records[: count * CYCLE.size]


def pack_scene(scene: SceneFrame) -> bytes:
    """Bytes of a `SceneFrame`, as its message is recorded."""
    traps, spheres = scene.traps, scene.spheres
    body = bytearray(_ENTRY.pack(scene.beat, scene.time, scene.contact_force))
    _put(body, "q", [trap.index for trap in traps])
    _put(body, "d", [x for trap in traps for x in trap.position])
    _put(body, "d", [trap.power for trap in traps])
    _put(body, "q", [sphere.body for sphere in spheres])
    _put(body, "d", [x for sphere in spheres for x in sphere.position])
    return HEAD + bytes(body)


def unpack_scene(data: bytes | memoryview) -> SceneFrame:
    """The state of a `SceneFrame`.

    Raises:
        InputError: It is none.
    """
    try:
        body = _body(data)
        beat, time, contact = _ENTRY.unpack_from(body)
        at, columns = _ENTRY.size, []
        for code in "qddqd":
            column, at = _take(body, code, at)
            columns.append(column)
        index, place, power, owner, centre = columns
        if not len(place) == 3 * len(index) == 3 * len(power) or len(centre) != 3 * len(owner):
            raise ValueError("columns of different lengths")
    except (struct.error, ValueError) as error:
        raise InputError(f"message {SCENE_TYPE}: cannot be read ({error})") from None
    foci, centres = zip(*[iter(place)] * 3, strict=True), zip(*[iter(centre)] * 3, strict=True)
    traps = tuple(TrapFrame(n, p, w) for n, p, w in zip(index, foci, power, strict=True))
    return SceneFrame(beat, time, tuple(SphereFrame(p, b) for p, b in zip(centres, owner, strict=True)), traps, contact)


def beat_of(data: bytes | memoryview) -> int:
    """The beat of a `SceneFrame`, without reading the rest.

    Raises:
        InputError: It is none.
    """
    try:
        return _ENTRY.unpack_from(_body(data))[0]
    except (struct.error, ValueError) as error:
        raise InputError(f"message {SCENE_TYPE}: cannot be read ({error})") from None


def pack_image(rows: bytes, width: int, height: int, time: int, frame: str) -> bytes:
    """Bytes of a `sensor_msgs/msg/Image` of grey levels, `mono8`, or `mono16` where there are two bytes a pixel.

    Args:
        rows: The levels, the highest row first; of two bytes the lower one first.
        width, height: [pixels].
        time: Of their light [ns since 1970].
        frame: In which they are.
    """
    name, encoding = frame.encode() + b"\0", b"mono8\0" if len(rows) == width * height else b"mono16\0"
    body = struct.pack("<iII", time // 10**9, time % 10**9, len(name)) + name
    body += bytes(-len(body) % 4) + struct.pack("<3I", height, width, len(encoding)) + encoding
    body += b"\0"  # is_bigendian
    return HEAD + body + bytes(-len(body) % 4) + struct.pack("<2I", len(rows) // max(height, 1), len(rows)) + rows


def unpack_image(data: bytes | memoryview) -> tuple[bytes, int, int]:
    """(rows, width, height) of what `pack_image` made.

    Raises:
        InputError: It is none.
    """
    try:
        body = _body(data)
        (size,) = struct.unpack_from("<I", body, 8)
        at = -(-(12 + size) // 4) * 4
        height, width, size = struct.unpack_from("<3I", body, at)
        at = -(-(at + 12 + size + 1) // 4) * 4
        step, count = struct.unpack_from("<2I", body, at)
        rows = bytes(body[at + 8 : at + 8 + count])
        if step not in (width, 2 * width) or len(rows) != step * height:
            raise ValueError(f"{len(rows)} bytes for {width} x {height} pixels")
    except (struct.error, ValueError) as error:
        raise InputError(f"message sensor_msgs/msg/Image: cannot be read ({error})") from None
    return rows, width, height


def pack_text(text: str) -> bytes:
    """Bytes of a `std_msgs/msg/String`."""
    data = text.encode() + b"\0"
    return HEAD + struct.pack("<I", len(data)) + data


def unpack_text(data: bytes | memoryview) -> str:
    """The text of a `std_msgs/msg/String`.

    Raises:
        InputError: It is none.
    """
    try:
        body = _body(data)
        (size,) = struct.unpack_from("<I", body)
        if size > len(body) - 4:
            raise ValueError(f"{size} bytes of text in {len(body)}")
        return bytes(body[4 : 4 + size]).rstrip(b"\0").decode()
    except (struct.error, ValueError) as error:
        raise InputError(f"message std_msgs/msg/String: cannot be read ({error})") from None


def _body(data: bytes | memoryview) -> memoryview:
    view = memoryview(data)
    if bytes(view[:2]) != HEAD[:2]:
        raise ValueError("not little-endian CDR")
    return view[len(HEAD) :]


def _aligned(at: int) -> int:
    return at + -at % 8


def _put(body: bytearray, code: str, values: Sequence[float]) -> None:
    """A sequence of 8-byte numbers; an empty one has no alignment of its own."""
    body += bytes(-len(body) % 4) + struct.pack("<I", len(values))
    if values:
        body += bytes(-len(body) % 8) + struct.pack(f"<{len(values)}{code}", *values)


def _take(body: memoryview, code: str, at: int) -> tuple[Sequence[float], int]:
    """A sequence of 8-byte numbers, and where it ends."""
    (count,) = struct.unpack_from("<I", body, at)
    at += 4
    if not count:
        return array(code), at
    at = _aligned(at)
    if count * 8 > len(body) - at:
        raise ValueError(f"{count} numbers in {len(body) - at} bytes")
    return struct.unpack_from(f"<{count}{code}", body, at), at + 8 * count
