"""The file of a recording: its topics, its messages of ROS 2, and the force laws in it, written and read bit for bit.

A frame is some twenty messages of a few hundred numbers. Built from message objects they took 0.5 ms of an interpreter
that the live loop shares; a `Template` is laid out once by CDR and takes a tenth of it.
"""

from __future__ import annotations

import base64
import dataclasses
import importlib.util
import json
import shutil
import struct
import sys
from array import array
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import check_place
from otwarp.haptics.core import SceneFrame
from otwarp.haptics.core.fields import Matrix
from otwarp.haptics.force.law import ForceGrid, IsotropicLaw, Law, SplitLaw, TableLaw
from otwarp.haptics.recording import (
    CAMERA,
    CYCLES,
    CYCLES_TYPE,
    DEFINITIONS,
    HEAD,
    PERCEPTION,
    SCENE,
    SCENE_TYPE,
    SCHEMAS,
    SUFFIX,
    pack_cycles,
    pack_image,
    pack_scene,
    pack_text,
    part_of,
)
from otwarp.laws.trap_law import FIELDS, TrapLaw
from otwarp.scene import IDENTITY, Scene
from otwarp.teleop import HANDS, LiveFrame
from otwarp.teleop.perception import PerceptionTurn
from otwarp.teleop.recording.scenery import METRE, WORLD, device_rotation, frame_of, marker_array, moving, schemas

FORMAT = 1
"""Version of what a recording holds."""
UNITS = "scene: um, s, pN, mW; hands: m, N; /tf and /scene/markers: m"
FLUSH_EVERY = 1.0
"""Seconds of a session that are lost at most when it is killed."""

TEXT, NUMBERS = "std_msgs/msg/String", "std_msgs/msg/Float64MultiArray"
POSE, WRENCH, TRANSFORMS = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped", "tf2_msgs/msg/TFMessage"
IMAGE = "sensor_msgs/msg/Image"
MARKERS = "visualization_msgs/msg/MarkerArray"


def load_writer() -> None:
    """Import what writes recordings, if it is installed: it takes 0.2 s, which a loop that runs already would feel."""
    if importlib.util.find_spec("rosbags") is not None:
        from rosbags.rosbag2 import Writer  # noqa: F401
        from rosbags.typesys import Stores, get_typestore

        get_typestore(Stores.ROS2_JAZZY)


def check_new_recording(path: str | Path) -> Path:
    """A place for a new recording; nothing is left there.

    Raises:
        InputError: A file that is there already or cannot be made, another ending, or no `rosbags`.
    """
    path = Path(path)
    if importlib.util.find_spec("rosbags") is None:
        raise InputError("a recording needs the package rosbags; install otwarp[teleop]")
    if path.suffix != SUFFIX:
        raise InputError(f"recording is {str(path)!r}; allowed: a name that ends in {SUFFIX}")
    part = part_of(path)
    check_place(path, "recording")
    for there in (path, part):
        if there.exists():
            raise InputError(f"recording is {str(path)!r}, and {there} exists; allowed: a new name")
    return path


class RecordingFile:
    """An MCAP file that is being written, by one thread.

    Args:
        path: Where it will be; until `close` it is `PATH.part/NAME.part.mcap`.
        scene: What moves.

    Raises:
        OSError: It cannot be written.
    """

    def __init__(self, path: Path, scene: Scene):
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.path, self.part = path, part_of(path)
        self._store = get_typestore(Stores.ROS2_JAZZY)
        for name, text in DEFINITIONS.items():
            self._store.register(get_types_from_msg(text, name))
        self._writer = Writer(self.part, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self._topics: dict[str, Any] = {}
        self._flushed = monotonic()
        self._moving = [obstacle for obstacle in scene.obstacles if moving(obstacle)]
        movers = (*(b.name for b in scene.bodies), *(t.prim for t in scene.traps), *(o.prim for o in self._moving))
        names = [frame_of(name) for name in movers]
        self._transforms, self._poses = transforms(WORLD, names), np.zeros((len(names), 7))
        self._poses[:, 6] = 1.0
        self._logged = 0
        self._of_hand = {hand: (pose(f"{hand}_device"), wrench(f"{hand}_device")) for hand in HANDS}
        self._arrays: dict[tuple[str, tuple[int, ...]], Template] = {}
        self._warned: tuple[str, ...] = ()
        self._scene = scene

    def scenery(self, time: int, axis_maps: Mapping[str, Matrix]) -> None:
        """What stays as it is: schemas, the shapes in their frames, and each device's frame, turned as it is mapped."""
        self.text(SCHEMAS, time, json.dumps(schemas(), ensure_ascii=False))
        still = transforms(WORLD, [f"{hand}_device" for hand in axis_maps])
        turns = [(0.0, 0.0, 0.0, *device_rotation(axis_map)) for axis_map in axis_maps.values()]
        self._write("/tf_static", TRANSFORMS, time, still.fill(time, np.array(turns).ravel()))
        drawn = self._store.serialize_cdr(marker_array(self._scene, time, self._store), MARKERS)
        self._write("/scene/markers", MARKERS, time, drawn)

    def text(self, topic: str, time: int, text: str) -> None:
        """Write a text (a line, or JSON) as `std_msgs/String` on a topic, at a time [ns]."""
        self._write(topic, TEXT, time, pack_text(text))

    def cycles(self, hand: str, time: int, lost: int, records: bytes) -> None:
        """A batch of the servo's cycles."""
        self._write(CYCLES + hand, CYCLES_TYPE, time, pack_cycles(hand, lost, records))

    def scene(self, scene: SceneFrame, time: int) -> None:
        """A state that was published to the servo."""
        self._write(SCENE, SCENE_TYPE, time, pack_scene(scene))

    def perceived(self, turn: PerceptionTurn, time: int, stamp: Callable[[float], int]) -> None:
        """What a camera said in a turn; images before what refers to them."""
        for name, levels, light in turn.pictures:
            rows = np.ascontiguousarray(levels[::-1], dtype="u1" if levels.itemsize == 1 else "<u2").tobytes()
            image = pack_image(rows, levels.shape[1], levels.shape[0], stamp(light), "camera")
            self._write(CAMERA + frame_of(name), IMAGE, time, image)
        self.text(PERCEPTION, time, json.dumps(turn.told))

    def frame(self, live: LiveFrame, time: int) -> None:
        """A frame of the session: poses, forces, loads, distances, warnings."""
        frame, tf = live.frame, self._poses
        bodies = len(frame.position[0])
        still = bodies + len(frame.trap_position[0])
        tf[:bodies, :3], tf[:bodies, 3:] = METRE * frame.position[0], frame.orientation[0]
        tf[bodies:still, :3] = METRE * frame.trap_position[0]
        for row, obstacle in zip(tf[still:], self._moving, strict=True):
            turn = obstacle.orientation.at(frame.time)
            row[:3], row[3:] = METRE * obstacle.position.at(frame.time), turn / np.linalg.norm(turn)
        self._write("/tf", TRANSFORMS, time, self._transforms.fill(time, tf.ravel()))
        for hand in live.hands:
            if hand.now is not None:
                pose, wrench = self._of_hand[hand.name]
                self._write(f"/hand/{hand.name}/pose", POSE, time, pose.fill(time, (*hand.now.position, *IDENTITY)))
                self._write(
                    f"/hand/{hand.name}/force", WRENCH, time, wrench.fill(time, (*hand.now.force, 0.0, 0.0, 0.0))
                )
        self._numbers("/trap/force", time, ("trap", "axis"), frame.trap_force[0])
        self._numbers("/trap/distance", time, ("trap",), frame.trap_distance[0])
        self._numbers("/trap/power", time, ("trap",), frame.trap_power[0])
        self._numbers("/body/contact_force", time, ("body", "axis"), frame.contact_force[0])
        self._numbers("/body/contact_load", time, ("body",), frame.contact_load[0])
        self._numbers("/hand/force_on_bodies", time, ("hand", "axis"), live.hand_force)
        for line in live.warnings:
            if line not in self._warned:
                self.text("/warnings", time, line)
        self._warned = live.warnings

    def close(self) -> None:
        """Write the index, and put the file where it belongs.

        Raises:
            OSError: It cannot be; what there is stays in the `.part` folder.
        """
        self._writer.close()
        (self.part / f"{self.part.name}.mcap").replace(self.path)
        shutil.rmtree(self.part)

    def discard(self) -> None:
        """End without a file: what was written so far is removed."""
        self._writer.abort()
        shutil.rmtree(self.part)

    def abort(self) -> None:
        """End without completing the file: what was written so far stays as it is."""
        self._writer.abort()

    def _write(self, topic: str, kind: str, time: int, data: bytes | memoryview) -> None:
        connection = self._topics.get(topic)
        if connection is None:
            connection = self._topics[topic] = self._writer.add_connection(topic, kind, typestore=self._store)
        # what comes late, as the cycles of a hand do, was logged late: its own stamps say when it was
        self._logged = max(self._logged, time)
        self._writer.write(connection, self._logged, data)
        now = monotonic()
        if now > self._flushed + FLUSH_EVERY:
            self._flushed = now
            # `Writer` itself ends a chunk after 1 MiB, which may be half a minute of a small scene
            storage: Any = self._writer.storage
            storage.close_chunk()
            storage.bio.flush()

    def _numbers(self, topic: str, time: int, axes: Sequence[str], values: np.ndarray) -> None:
        """An array whose layout says what its axes are."""
        template = self._arrays.get((topic, values.shape))
        if template is None:
            template = self._arrays[topic, values.shape] = array_of(axes, values.shape)
        self._write(topic, NUMBERS, time, template.fill(time, values.ravel()))


class Template:
    """A message with a stamp that it may have several times, and float64 numbers; all else is fixed.

    The parts are added in the order of the message's definition.
    """

    def __init__(self) -> None:
        self._fixed = bytearray()
        self._seconds: list[int] = []
        self._numbers: list[int] = []
        self._body = np.zeros(0, dtype=np.uint8)

    def text(self, value: str) -> Template:
        """Append a CDR string: its length, UTF-8 and a zero byte."""
        data = value.encode() + b"\0"
        self.count(len(data))
        self._fixed += data
        return self

    def count(self, value: int) -> Template:
        """A uint32, such as the length of a sequence."""
        self._align(4)
        self._fixed += struct.pack("<I", value)
        return self

    def header(self, frame: str) -> Template:
        """A `std_msgs/Header`."""
        self._align(4)
        self._seconds.append(len(self._fixed) // 4)
        self._fixed += bytes(8)
        return self.text(frame)

    def numbers(self, count: int) -> Template:
        """That many float64."""
        if count:
            self._align(8)
            first = len(self._fixed) // 8
            self._numbers += range(first, first + count)
            self._fixed += bytes(8 * count)
        return self

    def fill(self, time: int, numbers: np.ndarray | Sequence[float]) -> bytes:
        """The message at a time [ns since 1970]; `numbers` are all of them, in order."""
        if not len(self._body):
            self._finish()
        self._words[self._at] = time // 10**9
        self._words[self._at + 1] = time % 10**9
        self._floats[self._where] = numbers
        return HEAD + self._body.tobytes()[: len(self._fixed)]

    def _finish(self) -> None:
        self._body = np.zeros(-(-len(self._fixed) // 8) * 8, dtype=np.uint8)
        self._body[: len(self._fixed)] = np.frombuffer(self._fixed, dtype=np.uint8)
        self._words, self._floats = self._body.view("<u4"), self._body.view("<f8")
        self._at, self._where = np.array(self._seconds, dtype=int), np.array(self._numbers, dtype=int)

    def _align(self, size: int) -> None:
        self._fixed += bytes(-len(self._fixed) % size)


def transforms(frame: str, names: Sequence[str]) -> Template:
    """`tf2_msgs/TFMessage`; numbers are place and turn (x, y, z, w) of each."""
    template = Template().count(len(names))
    for name in names:
        template.header(frame).text(name).numbers(7)
    return template


def pose(frame: str) -> Template:
    """`geometry_msgs/PoseStamped`; numbers are place and turn."""
    return Template().header(frame).numbers(7)


def wrench(frame: str) -> Template:
    """`geometry_msgs/WrenchStamped`; numbers are force and torque."""
    return Template().header(frame).numbers(6)


def array_of(axes: Sequence[str], shape: Sequence[int]) -> Template:
    """`std_msgs/Float64MultiArray` whose layout says what its axes are."""
    template = Template().count(len(axes))
    for n, axis in enumerate(axes):
        template.text(axis).count(shape[n]).count(int(np.prod(shape[n:])))
    size = int(np.prod(shape))
    return template.count(0).count(size).numbers(size)


_CURVE = {"constant" if name == "offset" else name: name for name in FIELDS}
"""Field of a curve at 1 mW by its name in the file."""
_LAWS: dict[str, Any] = {"isotropic": IsotropicLaw, "split": SplitLaw, "table": TableLaw}
"""Laws by their kinds in the file."""


def laws_to_dict(laws: Mapping[int, Sequence[Law]]) -> dict[str, Any]:
    """Laws of traps, each law once: `laws`, a list, and `traps`, for each trap the indices of its laws.

    Raises:
        InputError: A law of another kind.
    """
    found: list[Law] = []
    traps: dict[str, list[int]] = {}
    for trap, choices in laws.items():
        row = traps[str(trap)] = []
        for law in choices:
            same = next((n for n, other in enumerate(found) if other is law or other == law), None)
            if same is None:
                same = len(found)
                found.append(law)
            row.append(same)
    return {"laws": [_law(law) for law in found], "traps": traps}


def laws_from_dict(data: Any) -> dict[int, tuple[Law, ...]]:
    """The laws that `laws_to_dict` wrote.

    Raises:
        InputError: They are none.
    """
    try:
        laws = [_read(item) for item in data["laws"]]
        return {int(trap): tuple(laws[n] for n in row) for trap, row in data["traps"].items()}
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise InputError(f"force laws: cannot be read ({error!r}); allowed: as a recording has them") from None


def _law(law: Law) -> dict[str, Any]:
    kind = next((name for name, known in _LAWS.items() if isinstance(law, known)), None)
    if kind is None:
        raise InputError(f"force law is {type(law).__name__}; allowed in a recording: isotropic, split or tabulated")
    return {"kind": kind, **_fields(law)}


def _fields(part: Any) -> dict[str, Any]:
    """Fields of a law or a grid as JSON has them."""
    found = {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
    for name, value in found.items():
        if isinstance(value, TrapLaw):
            found[name] = {key: getattr(value, field) for key, field in _CURVE.items()}
        elif name == "grids":
            found[name] = [_fields(grid) for grid in value]
        elif name == "node":  # float32 numbers, little-endian, as base64
            found[name] = base64.b64encode(_little(value).tobytes()).decode()
    return found


def _read(data: Mapping[str, Any]) -> Law:
    values = {**data}
    law = _LAWS[values.pop("kind")]
    for name, value in values.items():
        if name in ("axis", "side"):
            x, y, z = value
            values[name] = (x, y, z)
        elif name in ("curve", "radial", "axial"):
            values[name] = TrapLaw(**{_CURVE[key]: number for key, number in value.items()}, power=1.0)
        elif name == "grids":
            values[name] = tuple(ForceGrid(**grid | {"node": _decoded(grid["node"])}) for grid in value)
    return law(**values)


def _decoded(text: str) -> array[float]:
    node = array("f")
    node.frombytes(base64.b64decode(text, validate=True))
    return _little(node)


def _little(node: array[float]) -> array[float]:
    if sys.byteorder == "big":
        node = array("f", node)
        node.byteswap()
    return node
