"""`TopicCamera`: `sensor_msgs/Image` on a topic of ROS 1 or ROS 2, by the nodes of `otwarp.ros`.

Tested against publishers of the same nodes in this process; no camera driver of ROS was run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.perception.camera import CameraFrame, CameraInfo, CameraLost, Piece, Region
from otwarp.perception.files import grey

ENCODINGS = {"mono8": ("u1", 1), "8UC1": ("u1", 1), "mono16": ("u2", 1), "16UC1": ("u2", 1), "rgb8": ("u1", 3),
             "bgr8": ("u1", 3)}  # fmt: skip
"""Encoding → numbers of a pixel, and how many; of colours the second, green, counts."""

WAIT, LONGEST_WAIT, LOOK_EVERY = 5.0, 3600.0, 0.01
"""How long a camera waits for its first image unless told otherwise, at most, and between two looks [s]. ROS 2 finds a
publisher within a second or two."""

LARGEST = 1 << 25
"""Most bytes of an image."""


def levels_of(message: Any) -> np.ndarray:
    """(height, width) grey levels of a `sensor_msgs/Image`, row 0 the lowest.

    Raises:
        ValueError: An encoding that is not known, or data of another size.
    """
    if message.encoding not in ENCODINGS:
        raise ValueError(f"encoding is {message.encoding!r}; allowed: {', '.join(ENCODINGS)}")
    kind, channels = ENCODINGS[message.encoding]
    order = np.dtype((">" if message.is_bigendian else "<") + kind)
    high, wide, step = int(message.height), int(message.width), int(message.step)
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    if high < 1 or step < wide * channels * order.itemsize or data.size != high * step:
        raise ValueError(f"an image of {wide} × {high} has {data.size} bytes in rows of {step}")
    rows = data.reshape(high, step)[:, : wide * channels * order.itemsize]
    whole = np.ascontiguousarray(rows).view(order).reshape(high, wide, channels)
    image = whole[..., 1 if channels > 1 else 0].astype(order.newbyteorder("="))
    return np.ascontiguousarray(grey(image, "image")[::-1])


class TopicCamera:
    """A topic.

    Args:
        name: As the user named it.
        kind: Row of `kinds.KINDS`.
        wait: How long `open` waits for the first image [s]; 0 for one that may come at any time later.
        join: Opens a node, subscribes, and returns what gives the newest message or None, and what closes both.

    Raises:
        InputError: A negative wait, or one of more than `LONGEST_WAIT`.
    """

    def __init__(
        self, name: str, kind: str, wait: float, join: Callable[[], tuple[Callable[[], Any], Callable[[], None]]]
    ):
        if not 0.0 <= wait <= LONGEST_WAIT:
            raise InputError(f"--camera {name!r}: wait is {wait:g}; allowed: 0 to {LONGEST_WAIT:g} s")
        self._info = CameraInfo(name=name, kind=kind, stand_in="otwarp's own publishers")
        self._join, self._take, self._leave = join, None, None
        self._number, self._wait = 0, wait

    @classmethod
    def of_ros1(cls, where: str, *, name: str = "", master: str | None = None, wait: float = WAIT) -> TopicCamera:
        """A topic of ROS 1.

        Args:
            where: The topic.
            name: As the user named it.
            master: Its address; None: of the environment.
            wait: For the first image [s].
        """

        def join() -> tuple[Callable[[], Any], Callable[[], None]]:
            """What takes the newest message, and what leaves the topic, of a node of its own."""
            from otwarp.ros.ros1.messages import allow_sequences
            from otwarp.ros.ros1.node import Ros1Node

            allow_sequences(LARGEST)
            node = Ros1Node("otwarp_camera", master, most=2 * LARGEST)
            try:
                subscription = node.subscribe(where, "sensor_msgs/Image")
            except BaseException:
                node.close()
                raise
            return subscription.take, node.close

        return cls(name or where, "ros1", wait, join)

    @classmethod
    def of_ros2(cls, where: str, *, name: str = "", domain: int | None = None, wait: float = WAIT) -> TopicCamera:
        """A topic of ROS 2.

        Args:
            where: The topic.
            name: As the user named it.
            domain: Number of the domain; None: of the environment.
            wait: For the first image [s].
        """

        def join() -> tuple[Callable[[], Any], Callable[[], None]]:
            """What takes the newest message, and what leaves the topic, of a node of its own."""
            from otwarp.ros.ros2.node import Ros2Node

            node = Ros2Node("otwarp_camera", domain)
            try:
                subscription = node.subscribe(where, "sensor_msgs/msg/Image")
            except BaseException:
                node.close()
                raise
            return subscription.latest, node.close

        return cls(name or where, "ros2", wait, join)

    @property
    def info(self) -> CameraInfo:
        """See `Camera`."""
        return self._info

    def open(self) -> None:
        """See `Camera`; waits for an image, which is dropped: a topic that nobody publishes looks like a quiet one."""
        self._take, self._leave = self._join()
        end = time.monotonic() + self._wait
        while self._wait and self._take() is None:
            if time.monotonic() > end:
                self.close()
                raise InputError(
                    f"camera {self._info.name}: no image came within {self._wait:g} s; allowed: a topic on which a "
                    "camera publishes, or wait=SECONDS for a longer time, wait=0 for none"
                )
            time.sleep(LOOK_EVERY)

    def aim(self, regions: Sequence[Region]) -> None:
        """See `Camera`: whole frames come."""

    def read(self, now: float) -> CameraFrame | None:
        """See `Camera`."""
        message = self._take() if self._take is not None else None
        if message is None:
            return None
        try:
            levels = levels_of(message)
        except (ValueError, InputError) as error:
            raise CameraLost(f"camera {self._info.name}: {error}") from None
        self._number += 1
        stamp = message.header.stamp
        told = float(stamp.sec) + 1e-9 * float(stamp.nanosec)
        came = time.time()
        # stamps of ROS count from 1970; ours do not
        when = now if told == 0.0 else now - (came - told)
        return CameraFrame(number=self._number, time=when, exposure=0.0, pieces=(Piece(0, 0, levels),), sent=now)

    def close(self) -> None:
        """See `Camera`."""
        if self._leave is not None:
            self._leave()
        self._take = self._leave = None
