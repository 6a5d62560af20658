"""ROS 2 messages whose names and lengths do not change: laid out once by CDR, then only numbers are put in.

A frame is some twenty messages of a few hundred numbers. Built from message objects they took 0.5 ms of an interpreter
that the live loop shares; this takes a tenth of it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

HEAD = b"\x00\x01\x00\x00"
"""CDR, little-endian; what follows is aligned from its own beginning."""


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
        """A string."""
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
