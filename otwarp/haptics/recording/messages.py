"""The exact data of a take as ROS 2 messages: their definitions, and their bytes by CDR (OMG XCDR1, little-endian).

Both are made of 8-byte numbers, so that a batch of the servo's cycles is written as it lay in its ring, and floats come
back bit for bit.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Sequence

from otwarp.errors import InputError
from otwarp.haptics.core.types import CYCLE, SceneFrame, SphereFrame, TrapFrame

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

_HEAD = b"\x00\x01\x00\x00"
"""CDR, little-endian; what follows is aligned from its own beginning."""
_ENTRY = struct.Struct("<Q2d")


def pack_cycles(hand: str, lost: int, records: bytes) -> bytes:
    """`ServoCycles` of records as they come from a ring."""
    name = hand.encode() + b"\0"
    body = struct.pack("<I", len(name)) + name
    body += bytes(-len(body) % 8) + struct.pack("<QI", lost, len(records) // CYCLE.size)
    if records:
        body += bytes(-len(body) % 8)
    return _HEAD + body + records


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
    """`SceneFrame` as bytes."""
    traps, spheres = scene.traps, scene.spheres
    body = bytearray(_ENTRY.pack(scene.beat, scene.time, scene.contact_force))
    _put(body, "q", [trap.index for trap in traps])
    _put(body, "d", [x for trap in traps for x in trap.position])
    _put(body, "d", [trap.power for trap in traps])
    _put(body, "q", [sphere.body for sphere in spheres])
    _put(body, "d", [x for sphere in spheres for x in sphere.position])
    return _HEAD + bytes(body)


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


def pack_text(text: str) -> bytes:
    """`std_msgs/msg/String`."""
    data = text.encode() + b"\0"
    return _HEAD + struct.pack("<I", len(data)) + data


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
    if bytes(view[:2]) != _HEAD[:2]:
        raise ValueError("not little-endian CDR")
    return view[len(_HEAD) :]


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
