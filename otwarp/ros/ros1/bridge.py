"""The simulator's end of the paper's ROS 1 contract: what a live loop publishes, and how far the hands move traps."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

from otwarp.haptics.core import Vec3
from otwarp.haptics.core.realtime import next_deadline
from otwarp.ros.contract import (
    FRAME,
    HAND_TYPES,
    OBSTACLE_TOPICS,
    PAIR_TOPIC,
    ROBOT_TOPICS,
    SIMULATOR_TOPICS,
    TRANSFORM,
    TRAP_TOPICS,
    UPRIGHT,
    Axes,
    ContractConfig,
    HandTopics,
    Quat,
)
from otwarp.ros.motion import VelocityHold
from otwarp.ros.ros1.messages import types
from otwarp.ros.ros1.node import Ros1Node

FASTEST_HAND = 1e4
"""Speed of a hand above which a twist is refused [mm/s]: no device reports 10 m/s."""
EDGE = 1e-9
"""Seconds by which a time may miss its place on the grid by rounding."""

Place = Sequence[float]
"""x, y, z [µm]; a tuple or an array."""
Body = tuple[Place, Sequence[float]]
"""Position [µm] and orientation x, y, z, w."""


class Ros1Bridge:
    """Publishes the scene to the paper's topics and integrates the hands' twists.

        bridge = Ros1Bridge(node, ContractConfig(scene_unit=25.0))
        while ...:
            first, second = bridge.commands(clock())     # µm that each group's traps are to move
            bridge.publish(clock(), (trap0, trap1), ((p0, q0), (p1, q1)), obstacles)

    Args:
        node: Where the topics live; the caller closes it.
        config: Pairing, units, gain, rate.
        clock: Monotonic [s]; when a twist came. `commands` must be given times of the same clock.
        stamp: Seconds since 1970 for the headers.

    Attributes:
        skipped: Transforms that were not published because a number was not finite.

    Raises:
        InputError: A namespace that is no name, or a master that is gone.
    """

    def __init__(
        self,
        node: Ros1Node,
        config: ContractConfig | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        stamp: Callable[[], float] = time.time,
    ) -> None:
        self.config = config or ContractConfig()
        self._axes, self._stamp, self._types = Axes(self.config), stamp, types()
        self._clock = clock
        self._out: dict[str, Any] = {topic: node.publisher(topic, TRANSFORM) for topic in SIMULATOR_TOPICS}
        self._sequence: dict[str, int] = dict.fromkeys(SIMULATOR_TOPICS, 0)
        self._next = -math.inf
        self.skipped = 0
        self.hands: tuple[HandTopics, HandTopics] = self.config.hands()
        self._held: dict[int, VelocityHold] = {}
        self._in = [self._listen(node, hand) for hand in self.hands]

    def _listen(self, node: Ros1Node, hand: HandTopics) -> Any:
        held = self._held[hand.group] = VelocityHold(self.config.twist_timeout, FASTEST_HAND)

        def _twist(message: Any) -> None:
            linear = message.linear
            held.message((linear.x, linear.y, linear.z), self._clock())

        return node.subscribe(hand.smoothed_twist, HAND_TYPES["smoothed_twist"], _twist)

    def commands(self, now: float) -> tuple[Vec3, Vec3]:
        """How far the traps of group 0 and of group 1 are to move since the last call [µm].

        A velocity holds until the next one, and for `twist_timeout` at most: a hand's node that dies stops its traps.

        Args:
            now: On the clock of the bridge [s].
        """
        first, second = (self._axes.motion(self._held[group].displacement(now)) for group in (0, 1))
        return first, second

    @property
    def refused(self) -> int:
        """Twists that were not finite, or faster than a hand."""
        return sum(held.refused for held in self._held.values())

    def publish(
        self,
        now: float,
        traps: Sequence[Place | None],
        robots: Sequence[Body | None],
        obstacles: Sequence[Body | Place] = (),
    ) -> bool:
        """Publish the scene if the next period of `rate` has begun; True if so.

        Args:
            now: On any steady clock [s].
            traps: Of group 0 and 1; None leaves its topic silent.
            robots: As the traps; `/xform` needs both.
            obstacles: Up to four, with or without an orientation; more are left out.
        """
        if now + EDGE < self._next:
            return False
        period = 1.0 / self.config.rate
        self._next = now + period if self._next == -math.inf else next_deadline(self._next, period, now + EDGE)[0]
        seconds, nanoseconds = divmod(round(self._stamp() * 1e9), 1_000_000_000)
        stamp = self._types.Time(int(seconds), int(nanoseconds))
        for topic, place in zip(TRAP_TOPICS, traps, strict=False):
            if place is not None:
                self._send(topic, stamp, self._axes.point(place), UPRIGHT)
        places: list[Vec3] = []
        for topic, body in zip(ROBOT_TOPICS, robots, strict=False):
            if body is not None:
                position, orientation = self._axes.pose(body)
                places.append(position)
                self._send(topic, stamp, position, orientation)
        if len(places) == 2:
            (a, b, c), (x, y, z) = places
            self._send(PAIR_TOPIC, stamp, (0.5 * (a + x), 0.5 * (b + y), 0.5 * (c + z)), UPRIGHT)
        for topic, obstacle in zip(OBSTACLE_TOPICS, obstacles, strict=False):
            placed: Any = obstacle if len(obstacle) == 2 else (obstacle, None)
            turned = UPRIGHT if placed[1] is None else self._axes.orientation(placed[1])
            self._send(topic, stamp, self._axes.point(placed[0]), turned)
        return True

    def _send(self, topic: str, stamp: Any, position: Vec3, orientation: Quat) -> None:
        if not math.isfinite(sum(position) + sum(orientation)):
            self.skipped += 1
            return
        t = self._types
        header = t.Header(self._sequence[topic] % 2**32, stamp, FRAME)
        transform = t.Transform(t.Vector3(*position), t.Quaternion(*orientation))
        self._sequence[topic] += 1
        self._out[topic].publish(t.TFMessage([t.TransformStamped(header, topic.strip("/"), transform)]))

    def close(self) -> None:
        """Take the topics back; the node stays."""
        for one in (*self._in, *self._out.values()):
            one.close()
