"""Poses of a hand from a ROS bag: what a Touch's driver published, or a take that was turned into a bag.

Read by `rosbags`: ROS 1 `.bag`, ROS 2 bags in a folder or as one `.db3`. Positions count in metres unless told
otherwise; the driver of the paper's release publishes millimetres (`unit=mm`).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from otwarp.errors import InputError

UNITS = {"m": 1.0, "mm": 1e-3}
"""Metres."""
POSE = "geometry_msgs/msg/PoseStamped"
SUFFIXES = (".bag", ".db3")


def is_bag(file: Path) -> bool:
    """Whether a recording is a bag, by its name or because it is the folder of one."""
    return file.suffix.lower() in SUFFIXES or (file / "metadata.yaml").is_file()


def bag_samples(file: Path, topic: str | None, unit: str) -> Iterator[tuple[int, float, list[float], int]]:
    """(number, time, position, buttons) of the poses in a bag; times [s] count from the first, positions in metres.

    Args:
        file: `.bag`, `.db3`, or the folder of a ROS 2 bag.
        topic: Of type PoseStamped; None for the only one that there is.
        unit: Key of `UNITS`.

    Raises:
        InputError: No bag, no such topic, several to choose from, or no `rosbags`.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
    except ImportError:
        raise InputError(f"{file}: a bag needs the package rosbags; install otwarp[teleop]") from None
    if not file.exists():
        raise InputError(f"{file}: cannot be read (no such file)")
    try:
        with AnyReader([file], default_typestore=_typestore()) as bag:
            poses = [c for c in bag.connections if c.msgtype == POSE]
            names = sorted({c.topic for c in poses})
            chosen = topic or (names[0] if len(names) == 1 else None)
            if chosen not in names:
                allowed = ", ".join(f"topic={name}" for name in names) or f"a bag with a topic of type {POSE}"
                raise InputError(f"{file}: has no poses of {topic or 'a topic that was named'}; allowed: {allowed}")
            first, last = None, -1
            messages = bag.messages([c for c in poses if c.topic == chosen])
            for number, (connection, stamp, data) in enumerate(messages, 1):
                if stamp <= last:  # two messages that came at once: the first counts
                    continue
                first, last = stamp if first is None else first, stamp
                place: Any = bag.deserialize(data, connection.msgtype).pose.position  # type: ignore[attr-defined]
                scale = UNITS[unit]
                yield number, 1e-9 * (stamp - first), [scale * place.x, scale * place.y, scale * place.z], 0
    except InputError:
        raise
    except (AnyReaderError, OSError, ValueError, KeyError, AssertionError) as error:
        raise InputError(f"{file}: cannot be read as a bag ({error})") from None
    except Exception as error:  # a damaged bag fails in whatever its reader is made of
        raise InputError(f"{file}: cannot be read as a bag ({type(error).__name__}: {error})") from None


def _typestore() -> Any:
    """Types for bags that do not bring their own."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)
