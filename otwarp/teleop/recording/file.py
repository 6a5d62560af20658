"""The file of a take: its topics, and how a moment of a session is told in ROS 2 messages; runs beside the loop."""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.haptics.core.types import SceneFrame
from otwarp.haptics.recording.mcap import SUFFIX, part_of
from otwarp.haptics.recording.messages import CYCLES_TYPE, DEFINITIONS, SCENE_TYPE, pack_cycles, pack_scene, pack_text
from otwarp.scene.description import Scene
from otwarp.teleop.core.frame import HANDS, LiveFrame
from otwarp.teleop.recording.templates import Template, array_of, pose, transforms, wrench

COMMANDS, PACE, END, SCENE = "/otwarp/commands", "/otwarp/pace", "/otwarp/end", "/otwarp/scene"
CYCLES, START = "/otwarp/cycles/", "/otwarp/start/"
"""Followed by the name of the hand."""
WORLD = "world"
"""Frame of the scene, in µm."""

FLUSH_EVERY = 1.0
"""Seconds of a session that are lost at most when it is killed."""

TEXT, NUMBERS = "std_msgs/msg/String", "std_msgs/msg/Float64MultiArray"
POSE, WRENCH, TRANSFORMS = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped", "tf2_msgs/msg/TFMessage"


def load_writer() -> None:
    """Import what writes takes, if it is installed: it takes 0.2 s, which a loop that runs already would feel."""
    if importlib.util.find_spec("rosbags") is not None:
        from rosbags.rosbag2 import Writer  # noqa: F401
        from rosbags.typesys import Stores, get_typestore

        get_typestore(Stores.ROS2_JAZZY)


def check_place(path: str | Path) -> Path:
    """A place for a new take; nothing is left there.

    Raises:
        InputError: A file that is there already or cannot be made, another ending, or no `rosbags`.
    """
    path = Path(path)
    if importlib.util.find_spec("rosbags") is None:
        raise InputError("a recording needs the package rosbags; install otwarp[teleop]")
    if path.suffix != SUFFIX:
        raise InputError(f"recording is {str(path)!r}; allowed: a name that ends in {SUFFIX}")
    part = part_of(path)
    try:
        for there in (path, part):
            if there.exists():
                raise InputError(f"recording is {str(path)!r}, and {there} exists; allowed: a new name")
        if not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
            raise InputError(f"recording is {str(path)!r}; allowed: in a folder that exists and may be written")
        part.mkdir()  # a file system may say that it can be written, and refuse
        part.rmdir()
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError(f"recording is {str(path)!r}, which cannot be made ({why}); allowed: another place") from None
    return path


class TakeFile:
    """An MCAP file that is being written, by one thread.

    Args:
        path: Where it will be; until `close` it is `PATH.part/NAME.part.mcap`.
        scene: Names of bodies and traps.

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
        # tf names have no leading slash
        names = [name.lstrip("/") for name in (*(b.name for b in scene.bodies), *(t.prim for t in scene.traps))]
        self._transforms, self._poses = transforms(WORLD, names), np.zeros((len(names), 7))
        self._poses[:, 6] = 1.0
        self._of_hand = {hand: (pose(f"{hand}_device"), wrench(f"{hand}_device")) for hand in HANDS}
        self._arrays: dict[tuple[str, tuple[int, ...]], Template] = {}
        self._warned: tuple[str, ...] = ()

    def text(self, topic: str, time: int, text: str) -> None:
        """A line, or JSON."""
        self._write(topic, TEXT, time, pack_text(text))

    def cycles(self, hand: str, time: int, lost: int, records: bytes) -> None:
        """A batch of the servo's cycles."""
        self._write(CYCLES + hand, CYCLES_TYPE, time, pack_cycles(hand, lost, records))

    def scene(self, scene: SceneFrame, time: int) -> None:
        """A state that was published to the servo."""
        self._write(SCENE, SCENE_TYPE, time, pack_scene(scene))

    def frame(self, live: LiveFrame, time: int) -> None:
        """A frame of the session: poses, forces, loads, distances, warnings."""
        frame, tf = live.frame, self._poses
        bodies = len(frame.position[0])
        tf[:bodies, :3], tf[:bodies, 3:], tf[bodies:, :3] = (
            frame.position[0],
            frame.orientation[0],
            frame.trap_position[0],
        )
        self._write("/tf", TRANSFORMS, time, self._transforms.fill(time, tf.ravel()))
        for hand in live.hands:
            if hand.now is not None:
                pose, wrench = self._of_hand[hand.name]
                still = (0.0, 0.0, 0.0, 1.0)
                self._write(f"/hand/{hand.name}/pose", POSE, time, pose.fill(time, (*hand.now.position, *still)))
                self._write(f"/hand/{hand.name}/force", WRENCH, time, wrench.fill(time, (*hand.now.force, *still[:3])))
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
        """Leave nothing."""
        self._writer.abort()
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

    def _numbers(self, topic: str, time: int, axes: Sequence[str], values: np.ndarray) -> None:
        """An array whose layout says what its axes are."""
        template = self._arrays.get((topic, values.shape))
        if template is None:
            template = self._arrays[topic, values.shape] = array_of(axes, values.shape)
        self._write(topic, NUMBERS, time, template.fill(time, values.ravel()))
