"""The file of a take: its topics, and how a moment of a session is told in ROS 2 messages; runs beside the loop."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from otwarp.haptics.messages import CYCLES_TYPE, DEFINITIONS, SCENE_TYPE, pack_cycles, pack_scene, pack_text
from otwarp.haptics.types import SceneNow
from otwarp.scene.description import Scene
from otwarp.teleop.frame import LiveFrame

CONFIG, COMMANDS, PACE, END, SCENE = (
    "/otwarp/config",
    "/otwarp/commands",
    "/otwarp/pace",
    "/otwarp/end",
    "/otwarp/scene",
)
CYCLES, START = "/otwarp/cycles/", "/otwarp/start/"
"""Followed by the name of the hand."""
WORLD = "world"
"""Frame of the scene, in µm."""

FLUSH_EVERY = 1.0
"""Seconds of a session that are lost at most when it is killed."""

TEXT, NUMBERS = "std_msgs/msg/String", "std_msgs/msg/Float64MultiArray"
POSE, WRENCH, TRANSFORMS = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped", "tf2_msgs/msg/TFMessage"


class TakeFile:
    """An MCAP file that is being written, by one thread.

    Args:
        path: Where it will be; until `close` it is `PATH.part/NAME.part.mcap`.
        scene: Names of bodies and traps.
        hands: Their names.

    Raises:
        OSError: It cannot be written.
    """

    def __init__(self, path: Path, scene: Scene, hands: Sequence[str]):
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
        self._bodies = [body.name.lstrip("/") for body in scene.bodies]
        self._traps = [trap.prim.lstrip("/") for trap in scene.traps]
        self._hands, self._warned = tuple(hands), ()
        self._still: np.ndarray = np.array([0.0, 0.0, 0.0, 1.0])

    def text(self, topic: str, time: int, text: str) -> None:
        """A line, or JSON."""
        self._write(topic, TEXT, time, pack_text(text))

    def cycles(self, hand: str, time: int, lost: int, records: bytes) -> None:
        """A batch of the servo's cycles."""
        self._write(CYCLES + hand, CYCLES_TYPE, time, pack_cycles(hand, lost, records))

    def scene(self, scene: SceneNow, time: int) -> None:
        """A state that was published to the servo."""
        self._write(SCENE, SCENE_TYPE, time, pack_scene(scene))

    def frame(self, live: LiveFrame, time: int) -> None:
        """A frame of the session: poses, forces, loads, distances, warnings."""
        frame, head = live.frame, self._header(time, WORLD)
        places = zip(self._bodies, frame.position[0].tolist(), frame.orientation[0].tolist(), strict=True)
        foci = [(name, place, self._still) for name, place in zip(self._traps, frame.trap_position[0], strict=True)]
        transforms = [self._transform(head, name, place, turn) for name, place, turn in (*places, *foci)]
        self._message("/tf", TRANSFORMS, time, transforms=transforms)
        for hand in live.hands:
            if hand.now is not None:
                head = self._header(time, f"{hand.name}_device")
                pose = self._make("Pose", position=self._point(hand.now.position), orientation=self._turn(self._still))
                self._message(f"/hand/{hand.name}/pose", POSE, time, header=head, pose=pose)
                force = {"force": self._vector(hand.now.force), "torque": self._vector((0.0, 0.0, 0.0))}
                wrench = self._make("Wrench", **force)
                self._message(f"/hand/{hand.name}/force", WRENCH, time, header=head, wrench=wrench)
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

    def abort(self) -> None:
        """Leave what there is as it is."""
        self._writer.abort()

    def _write(self, topic: str, kind: str, time: int, data: bytes | memoryview) -> None:
        connection = self._topics.get(topic)
        if connection is None:
            connection = self._topics[topic] = self._writer.add_connection(topic, kind, typestore=self._store)
        self._writer.write(connection, time, data)
        now = monotonic()
        if now > self._flushed + FLUSH_EVERY:
            self._flushed = now
            # `Writer` itself ends a chunk after 1 MiB, which may be half a minute of a small scene
            storage: Any = self._writer.storage
            storage.close_chunk()
            storage.bio.flush()

    def _message(self, topic: str, kind: str, time: int, **fields: Any) -> None:
        self._write(topic, kind, time, self._store.serialize_cdr(self._store.types[kind](**fields), kind))

    def _numbers(self, topic: str, time: int, axes: Sequence[str], values: np.ndarray) -> None:
        """An array whose layout says what its axes are."""
        make, dims = self._of("std_msgs/msg/MultiArrayDimension"), []
        for n, axis in enumerate(axes):
            dims.append(make(label=axis, size=values.shape[n], stride=int(np.prod(values.shape[n:]))))
        layout = self._of("std_msgs/msg/MultiArrayLayout")(dim=dims, data_offset=0)
        self._message(topic, NUMBERS, time, layout=layout, data=np.ascontiguousarray(values, dtype=np.float64).ravel())

    def _header(self, time: int, frame: str) -> Any:
        stamp = self._of("builtin_interfaces/msg/Time")(sec=time // 10**9, nanosec=time % 10**9)
        return self._of("std_msgs/msg/Header")(stamp=stamp, frame_id=frame)

    def _transform(self, head: Any, name: str, place: Sequence[float], turn: Sequence[float]) -> Any:
        transform = self._make("Transform", translation=self._vector(place), rotation=self._turn(turn))
        return self._make("TransformStamped", header=head, child_frame_id=name, transform=transform)

    def _point(self, place: Sequence[float]) -> Any:
        return self._make("Point", x=float(place[0]), y=float(place[1]), z=float(place[2]))

    def _vector(self, v: Sequence[float]) -> Any:
        return self._make("Vector3", x=float(v[0]), y=float(v[1]), z=float(v[2]))

    def _turn(self, q: Sequence[float]) -> Any:
        return self._make("Quaternion", x=float(q[0]), y=float(q[1]), z=float(q[2]), w=float(q[3]))

    def _make(self, name: str, **fields: Any) -> Any:
        return self._of(f"geometry_msgs/msg/{name}")(**fields)

    def _of(self, kind: str) -> Callable[..., Any]:
        return self._store.types[kind]


def part_of(path: Path) -> Path:
    """The folder in which a take lies while it is written, and stays if its session is killed."""
    return path.with_name(path.name + ".part")
