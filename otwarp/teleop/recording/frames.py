"""The moments of a recording, for those who look at it: poses, powers, forces and loads of every frame.

Every frame has one message on each of some topics, in order, so the n-th of each belong together whatever their log
times. Layouts do not change within a recording: where the numbers lie is found from the first message of a topic.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.haptics.devices.replay import is_bag
from otwarp.haptics.recording import CONFIG, HEAD, PACE, McapFile, is_recording, unpack_text
from otwarp.scene import Scene
from otwarp.teleop.recording.file import FORMAT
from otwarp.teleop.recording.scenery import METRE, frame_of

POSES = "/tf"
ARRAYS = {
    "trap_force": "/trap/force",
    "trap_distance": "/trap/distance",
    "trap_power": "/trap/power",
    "contact_force": "/body/contact_force",
    "contact_load": "/body/contact_load",
}
"""Topics of the quantities of a frame."""
WORDS = 8
"""Bytes of a number."""


@dataclass(frozen=True, eq=False)
class SessionFrames:
    """n frames of a session.

    Attributes:
        about: What the recording says of itself, as it stands in `/otwarp/config`.
        time: (n,) of the loop's clock, from the first frame on [s].
        simulated: (n,) simulated time, which a reset sets back [s].
        poses: Frame (a body's name, a trap's prim) → (n, 7) place [µm] and turn (x, y, z, w), float32.
        arrays: Quantity of `ARRAYS` → (n, …), float32.
        complete: Whether the recording was ended, not cut short.
    """

    about: Mapping[str, Any]
    time: np.ndarray
    simulated: np.ndarray
    poses: Mapping[str, np.ndarray]
    arrays: Mapping[str, np.ndarray]
    complete: bool


def is_session(path: Path) -> bool:
    """Whether a file or folder is named as recordings of sessions are: MCAP, or a bag that was made of one."""
    return is_recording(path) or is_bag(path)


def read_frames(path: Path) -> SessionFrames:
    """The frames of a recording, or of a bag that `rosbags-convert` made of one.

    Args:
        path: `.mcap`, the folder `.mcap.part` of a session that was killed, `.bag`, `.db3`, or a folder of ROS 2.

    Raises:
        InputError: It cannot be read, is no recording of this version, or has no frame.
    """
    about: Any = None
    clock: list[tuple[float, float]] = []
    topics = {POSES: _Numbers(_of_transforms)} | {topic: _Numbers(_of_array) for topic in ARRAYS.values()}
    messages = _Messages(path)
    try:
        for topic, data in messages.all({CONFIG, PACE, *topics}):
            if topic == CONFIG:
                about = json.loads(unpack_text(data))
            elif topic == PACE:
                pace = json.loads(unpack_text(data))
                clock.append((float(pace["wall"]), float(pace["simulated"])))
            else:
                topics[topic].add(data)
    except InputError:
        raise
    except (struct.error, ValueError, KeyError, IndexError) as error:
        raise InputError(f"{path}: has a message that cannot be read ({error}); allowed: as otwarp wrote it") from None
    if not isinstance(about, dict):
        raise InputError(f"{path}: is no recording of otwarp, or too little of one; it has no {CONFIG}")
    if about.get("format") != FORMAT:
        raise InputError(f"{path}: is a recording of format {about.get('format')!r}; allowed: {FORMAT}")
    count = min(len(clock), *(numbers.count for numbers in topics.values()))
    if not count:
        raise InputError(f"{path}: frames = 0; allowed: 1 or more")
    times = np.array(clock[:count])
    arrays = {name: topics[topic].rows(count) for name, topic in ARRAYS.items()}
    for name in ("trap_force", "contact_force"):
        arrays[name] = arrays[name].reshape(count, -1, 3)
    table = topics[POSES].rows(count).reshape(count, -1, 7)
    table[:, :, :3] /= METRE
    poses = {name: table[:, n] for n, name in enumerate(topics[POSES].names)}
    return SessionFrames(about, times[:, 0] - times[0, 0], times[:, 1], poses, arrays, messages.complete)


def scene_of(path: Path, about: Mapping[str, Any], file: Path | None = None) -> Scene:
    """The scene that a recording is of, with those of its bodies that were simulated.

    Args:
        path: Of the recording, for errors.
        about: `SessionFrames.about`.
        file: Of the scene; None for where it was when the session ran.

    Raises:
        InputError: It is not there, or has other bodies or traps.
    """
    from dataclasses import replace

    said = about.get("scene") or {}
    stage = file if file is not None else Path(said.get("file") or "")
    if not stage.is_file():
        where = f"its scene {stage} is not there" if said.get("file") else "its scene was no file"
        raise InputError(f"{path}: {where}; allowed: --scene FILE, which says where it is now")
    scene = Scene.load(stage)
    bodies = {body.name: body for body in scene.bodies}
    names, traps = said.get("bodies", []), said.get("traps", [])
    lacks = [name for name in names if name not in bodies]
    if lacks or traps != [trap.prim for trap in scene.traps]:
        what = f"lacks {lacks[0]}" if lacks else "has other traps"
        raise InputError(f"{stage}: {what}, which {path.name} recorded; allowed: the scene as it was then")
    return scene if len(names) == len(bodies) else replace(scene, bodies=tuple(bodies[n] for n in names), judged=True)


def frame_names(scene: Scene) -> tuple[list[str], list[str]]:
    """Keys of `SessionFrames.poses` of bodies and of traps."""
    return [frame_of(body.name) for body in scene.bodies], [frame_of(trap.prim) for trap in scene.traps]


class _Messages:
    """Messages of a recording or a bag, as CDR."""

    def __init__(self, path: Path):
        self._path, self.complete = path, False

    def all(self, topics: set[str]) -> Iterator[tuple[str, memoryview]]:
        """Topic and CDR of each message of some topics, in their order."""
        if not is_recording(self._path):
            yield from self._of_bag(topics)
            return
        with McapFile(self._path) as file:
            for message in file.messages(topics):
                yield message.topic, message.data
            self.complete = file.complete

    def _of_bag(self, topics: set[str]) -> Iterator[tuple[str, memoryview]]:
        try:
            from rosbags.highlevel import AnyReader, AnyReaderError
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise InputError(f"{self._path}: a bag needs the package rosbags; install otwarp[teleop]") from None
        store = get_typestore(Stores.ROS2_JAZZY)  # a bag of ROS 1 has headers with a number, which is not copied
        try:
            with AnyReader([self._path], default_typestore=store) as bag:
                wanted = [c for c in bag.connections if c.topic in topics]
                for connection, _, data in bag.messages(wanted) if wanted else ():
                    raw = data if bag.is2 else store.ros1_to_cdr(data, connection.msgtype)
                    yield connection.topic, memoryview(raw)
            self.complete = True
        except (AnyReaderError, OSError) as error:
            raise InputError(f"{self._path}: cannot be read as a bag ({error})") from None


class _Numbers:
    """Numbers of the messages of one topic.

    Args:
        layout: Names in a message, and where its numbers lie, in words.
    """

    def __init__(self, layout: Any):
        self._layout, self._at = layout, np.zeros(0, dtype=int)
        self._body = bytearray()
        self.names: list[str] = []
        self.count = 0

    def add(self, data: memoryview) -> None:
        """The next message."""
        body = data[len(HEAD) :]
        if not self.count:
            self.names, self._at = self._layout(body)
        words = np.frombuffer(body[: len(body) // WORDS * WORDS], dtype="<f8")
        self._body += words[self._at].astype("<f4").tobytes()
        self.count += 1

    def rows(self, count: int) -> np.ndarray:
        """(count, m) of the first messages, float32."""
        return np.frombuffer(bytes(self._body), dtype="<f4").reshape(self.count, -1)[:count].copy()


def _of_transforms(body: memoryview) -> tuple[list[str], np.ndarray]:
    (count,) = struct.unpack_from("<I", body)
    names: list[str] = []
    words: list[int] = []
    at = 4
    for _ in range(count):
        _, at = _text(body, at + 8)
        name, at = _text(body, _up(at, 4))
        names.append(name)
        first = _up(at, WORDS) // WORDS
        words += range(first, first + 7)
        at = WORDS * (first + 7)
    return names, np.array(words, dtype=int)


def _of_array(body: memoryview) -> tuple[list[str], np.ndarray]:
    (axes,) = struct.unpack_from("<I", body)
    at = 4
    for _ in range(axes):
        _, at = _text(body, at)
        at = _up(at, 4) + 8
    _, count = struct.unpack_from("<2I", body, _up(at, 4))
    first = _up(_up(at, 4) + 8, WORDS) // WORDS
    return [], np.arange(first, first + count)


def _text(body: memoryview, at: int) -> tuple[str, int]:
    at = _up(at, 4)
    (size,) = struct.unpack_from("<I", body, at)
    return bytes(body[at + 4 : at + 4 + size]).rstrip(b"\0").decode(), at + 4 + size


def _up(at: int, size: int) -> int:
    return at + -at % size
