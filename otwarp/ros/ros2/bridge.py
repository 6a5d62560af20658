"""The twin's bridge to ROS 2: what it tells a controller, and what a controller and two hands ask of it.

Topics and meanings are the contract of the public release `Zongcai23/ot-haptic-feedback-digital-twin` and of its RL
companion `Zongcai23/digital-twin-ros2-rl-navigation`; states leave as `tf2_msgs/TFMessage` with exactly one transform.
The bridge has no loop and no clock of its own: a live loop calls `publish` and `commands` with its time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.core.presets import PAIRINGS
from otwarp.haptics.core.types import ZERO, Vec3
from otwarp.ros.motion import VelocityHold
from otwarp.ros.ros2.config import Ros2Config
from otwarp.ros.ros2.motion import Group, centroid, middle
from otwarp.ros.ros2.node import Ros2Node, load_messages
from otwarp.ros.ros2.qos import RELIABLE, SENSOR_DATA

Quat = tuple[float, float, float, float]
Pose = tuple[Vec3, Quat]
"""Position [µm] and rotation, a unit quaternion with the scalar last."""

UPRIGHT: Quat = (0.0, 0.0, 0.0, 1.0)
MOST_OBSTACLES = 4
"""Of the contract: `/DynaOb01` to `/DynaOb04`."""

RESET_LEVEL = 0.5
"""`/resetSignal` is sent as 0 and 1; what lies above the middle is a 1."""

LAST_SECOND = 2.0**31
"""ROS 2 counts seconds in 32 bits with a sign."""

LARGEST = 1e12
"""Largest length [µm] or force [pN] that is published: beyond any scene, so a state that has run away."""


@dataclass(frozen=True, slots=True)
class Ros2Commands:
    """What has been asked since the last call.

    Attributes:
        velocity: Of the pair in the plane, as it counts now [µm/s].
        turn: Of the pair about the vertical, as it counts now [rad/s].
        shift: How far the pair was to move since the last call [µm].
        angle: How far it was to turn since the last call [rad].
        hands: How far each group was to move by its hand since the last call [µm].
        reset: Whether a reset was asked for.
    """

    velocity: tuple[float, float] = (0.0, 0.0)
    turn: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)
    angle: float = 0.0
    hands: tuple[Vec3, Vec3] = (ZERO, ZERO)
    reset: bool = False


def pair_yaw(first: Vec3, second: Vec3) -> Quat:
    """Rotation about the vertical that turns x along the line from the second robot to the first.

    So it is none where the companion starts: its second robot stands at the −x side of the midpoint. The companion
    takes a heading and its opposite for the same.
    """
    half = math.atan2(first[1] - second[1], first[0] - second[0]) / 2.0
    return (0.0, 0.0, math.sin(half), math.cos(half))


def _check_now(now: float) -> None:
    """Refuse what is no time."""
    if not math.isfinite(now):
        raise InputError(f"now is {now!r}; allowed: a finite time")


class Ros2Bridge:
    """Publishes the twin's states and collects commands.

    Publishes reliably, subscribes best-effort: both match ROS 2's default and sensor profiles.

    Args:
        node: Where the topics live; the caller closes it.
        config: Units, rates, limits and names.

    Attributes:
        refused: Messages that were read and not believed: not finite, or beyond the limits.
    """

    def __init__(self, node: Ros2Node, config: Ros2Config | None = None):
        self.config = config = Ros2Config() if config is None else config
        self._m: Any = load_messages()
        self.refused = 0
        names = ["firstOTposition", "secondOTposition", "robot01", "robot02", "xform", "object"]
        names += [f"DynaOb0{n + 1}" for n in range(MOST_OBSTACLES)]
        names += [f"DynaOb0{n + 1}Collide" for n in range(MOST_OBSTACLES)]
        self._out = {name: node.publisher(config.topic(name), self._m.TFMessage, RELIABLE) for name in names}
        twist = self._m.Twist
        self._velocity_in = node.subscribe(config.topic("rl_vel"), twist, SENSOR_DATA)
        self._reset_in = node.subscribe(config.topic("resetSignal"), twist, SENSOR_DATA)
        sides = sorted(PAIRINGS[config.pairing].values(), key=lambda side: side.group)
        self._hands_in = [
            node.subscribe(config.topic(f"{side.namespace}/{side.smoothed_twist}"), twist, SENSOR_DATA)
            for side in sides
        ]
        self._pair = VelocityHold(config.timeout)
        self._hands = [VelocityHold(config.hand_timeout) for _ in sides]
        self._due, self._last, self._reset_high = -math.inf, -math.inf, False

    @property
    def malformed(self) -> int:
        """Messages that could not be read at all."""
        return sum(s.malformed for s in (self._velocity_in, self._reset_in, *self._hands_in))

    def publish(
        self,
        now: float,
        *,
        traps: tuple[Group, Group],
        robots: tuple[Pose, Pose],
        cell: Vec3 | None = None,
        obstacles: Sequence[Pose] = (),
        contact_force: float = 0.0,
        cell_lost: bool = False,
        collision: bool = False,
        collision_force: float = 0.0,
        hits: Sequence[tuple[bool, float]] = (),
        time: float | None = None,
    ) -> bool:
        """Send the twin's state, at most `communication_rate` times a second; never waits.

        Args:
            now: On the loop's clock [s].
            traps: Foci of the first and of the second group (n, 3) [µm]; their centroids are published.
            robots: Poses of the first and of the second robot; `/xform` is halfway, turned along the pair.
            cell: Its centre [µm], or None where there is none: `/object` stays silent.
            obstacles: Poses of up to four dynamic obstacles.
            contact_force: On the cell [pN].
            cell_lost: Whether the pair has lost the cell.
            collision, collision_force: Whether the cell or pair has hit an obstacle, and how hard [pN].
            hits: Per obstacle, whether it was hit and how hard [pN].
            time: Simulated time for the stamps [s]; None takes `now`.

        Returns:
            Whether it was time to send.

        Raises:
            InputError: A number that is not finite or too large, an empty group, too many obstacles; nothing is sent.
        """
        _check_now(now)
        period = 1.0 / self.config.communication_rate
        if self._due - period <= now < self._due:
            return False
        unit, force = self.config.scene_unit, self.config.force_unit
        if len(obstacles) > MOST_OBSTACLES or len(hits) > MOST_OBSTACLES:
            raise InputError(f"obstacles are {max(len(obstacles), len(hits))}; allowed: up to {MOST_OBSTACLES}")
        if not all(len(group) for group in traps):
            raise InputError("traps has an empty group; allowed: one trap or more in each")
        states = self._poses(traps, robots, obstacles)
        if cell is not None:
            flags = (contact_force / force, float(not cell_lost), float(collision), collision_force / force)
            states.append(("object", cell, flags, unit))
        for n, (hit, strength) in enumerate(hits):
            states.append((f"DynaOb0{n + 1}Collide", (float(hit), strength / force, 0.0), UPRIGHT, 1.0))
        stamp = self._stamp(now if time is None else time)
        # all are made before any is sent: a bad number anywhere sends nothing
        for name, message in [(state[0], self._message(stamp, *state)) for state in states]:
            self._out[name].publish(message)
        # on the grid of the rate; after a pause, or a clock that went back, a new grid and no burst
        self._due = self._due + period if 0.0 <= now - self._due < period else now + period
        return True

    def _poses(
        self, traps: tuple[Group, Group], robots: tuple[Pose, Pose], obstacles: Sequence[Pose]
    ) -> list[tuple[str, Vec3, Quat, float]]:
        """Topic, position, rotation and unit of length of all that has a place."""
        unit = self.config.scene_unit
        states: list[tuple[str, Vec3, Quat, float]] = []
        for name, group in zip(("firstOTposition", "secondOTposition"), traps, strict=True):
            states.append((name, centroid(group), UPRIGHT, unit))
        for name, (position, rotation) in zip(("robot01", "robot02"), robots, strict=True):
            states.append((name, position, rotation, unit))
        first, second = robots[0][0], robots[1][0]
        states.append(("xform", middle(first, second), pair_yaw(first, second), unit))
        for n, (position, rotation) in enumerate(obstacles):
            states.append((f"DynaOb0{n + 1}", position, rotation, unit))
        return states

    def _stamp(self, time: float) -> Any:
        """Time as ROS 2 has it."""
        if not 0.0 <= time < LAST_SECOND:
            raise InputError(f"time is {time!r}; allowed: 0 to {LAST_SECOND:.0f} s")
        seconds = math.floor(time)
        return self._m.Time(seconds, min(int((time - seconds) * 1e9), 999_999_999))

    def _message(self, stamp: Any, name: str, position: Vec3, rotation: Quat, unit: float) -> Any:
        """One transform, its lengths in scene units."""
        if not all(abs(x) <= LARGEST for x in (*position, *rotation)):
            raise InputError(f"{name} is {(*position, *rotation)!r}; allowed: finite, up to {LARGEST:g}")
        m = self._m
        x, y, z = position
        transform = m.Transform(m.Vector3(x / unit, y / unit, z / unit), m.Quaternion(*map(float, rotation)))
        header = m.Header(stamp, self.config.frame)
        return m.TFMessage([m.TransformStamped(header, name, transform)])

    def commands(self, now: float) -> Ros2Commands:
        """What was asked since the last call; never waits.

        A velocity holds from the call that finds it until the next one or its timeout. A reset is the step of
        `/resetSignal` from 0 to 1; it drops every velocity that came before it.

        Args:
            now: On the loop's clock [s]; one that goes back drops every velocity.

        Raises:
            InputError: A time that is not finite.
        """
        _check_now(now)
        if now < self._last:
            self._drop()
        self._last = now
        moved = self._pair.displacement(now)
        hands = [hand.displacement(now) for hand in self._hands]
        self._read(self._velocity_in, self._planar, self._pair, now)
        for source, held in zip(self._hands_in, self._hands, strict=True):
            self._read(source, self._hand, held, now)
        reset = self._reset()
        if reset:
            self._drop()
        vx, vy, turn = self._pair.at(now)
        return Ros2Commands((vx, vy), turn, moved[:2], moved[2], (hands[0], hands[1]), reset)

    def _drop(self) -> None:
        """Forget every velocity."""
        for held in (self._pair, *self._hands):
            held.drop()

    def _read(self, source: Any, meaning: Callable[[Any], Vec3 | None], held: VelocityHold, now: float) -> None:
        """Hold the newest velocity that can be believed."""
        for message in source.take():
            value = meaning(message)
            if value is None:
                self.refused += 1
            else:
                held.message(value, now)

    def _planar(self, twist: Any) -> Vec3 | None:
        """(µm/s, µm/s, rad/s) of a `/rl_vel`, or None."""
        c = self.config
        x, y, turn = twist.linear.x, twist.linear.y, twist.angular.z
        if not (abs(x) <= c.speed_limit and abs(y) <= c.speed_limit and abs(turn) <= c.turn_limit):
            return None
        return (x * c.scene_unit, y * c.scene_unit, math.radians(turn))

    def _hand(self, twist: Any) -> Vec3 | None:
        """µm/s of a group from a hand's mm/s, or None."""
        c = self.config
        v = (twist.linear.x, twist.linear.y, twist.linear.z)
        if not all(abs(x) <= c.hand_speed_limit for x in v):
            return None
        gain = c.motion_gain * 1e-3
        x, y, z = (gain * (row[0] * v[0] + row[1] * v[1] + row[2] * v[2]) for row in c.axis_map)
        return (x, y, z)

    def _reset(self) -> bool:
        """Whether the reset signal has risen."""
        risen = False
        for message in self._reset_in.take():
            level = message.angular.x
            if not math.isfinite(level):
                self.refused += 1
                continue
            high = level > RESET_LEVEL
            risen = risen or (high and not self._reset_high)
            self._reset_high = high
        return risen
