"""The simulator's end of ROS 2: what it publishes for a controller, and what a controller and two hands ask of it.

Topics and meanings are the contract of the public release `Zongcai23/ot-haptic-feedback-digital-twin` and of its RL
companion `Zongcai23/digital-twin-ros2-rl-navigation`; states leave as `tf2_msgs/TFMessage` with exactly one transform.
The bridge has no loop and no clock of its own: a live loop calls `publish` and `commands` with its time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, Vec3
from otwarp.haptics.core.config import FACING_USER, PAIRINGS, check_orthogonal
from otwarp.haptics.core.fields import Matrix, check_fields, number
from otwarp.ros.contract import (
    CELL_TOPIC,
    FRAME,
    HIT_TOPICS,
    OBSTACLE_TOPICS,
    PAIR_TOPIC,
    RESET_TOPIC,
    ROBOT_TOPICS,
    SIMULATOR_TOPICS,
    TRAP_TOPICS,
    UPRIGHT,
    VELOCITY_TOPIC,
    Quat,
    TopicState,
)
from otwarp.ros.motion import VelocityHold, midpoint
from otwarp.ros.ros2.dds import RELIABLE, SENSOR_DATA, resolve_topic
from otwarp.ros.ros2.node import Ros2Node, load_messages

FEWEST_PERIODS = 1.0
"""A timeout below one period of control would stop the pair between any two commands."""

RESET_LEVEL = 0.5
"""`/resetSignal` is sent as 0 and 1; what lies above the middle is a 1."""

LAST_SECOND = 2.0**31
"""ROS 2 counts seconds in 32 bits with a sign."""

LARGEST = 1e12
"""Largest length [µm] or force [pN] that is published: beyond any scene, so a state that has run away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ros2Config:
    """What the bridge says and hears, and in which units.

    Attributes:
        pairing: Key of `otwarp.haptics.core.config.PAIRINGS`: names and sides of the hands' topics.
        namespace: Put before every topic, as `/twin`; empty for none.
        frame: `frame_id` of what is published.
        scene_unit: Micrometres in one unit of length on the topics. The companion's scenes are drawn in units of some
            15 to 35 µm, more is not known; 1 publishes micrometres.
        force_unit: Piconewtons in one unit of force on the topics.
        communication_rate: Most publications a second [Hz].
        control_rate: Commands a second that the controller sends [Hz].
        timeout: Age at which a velocity of the controller counts as zero [s]; at least a period of control.
        hand_timeout: Age at which a velocity of a hand counts as zero [s]; a device sends hundreds a second.
        speed_limit: Fastest planar velocity that is believed, each component [scene units/s]; the companion
            clips there.
        turn_limit: Fastest turn that is believed [deg/s].
        hand_speed_limit: Fastest hand that is believed, each component [mm/s].
        motion_gain: Of the paper's G_control [µm of trap per m of hand].
        axis_map: A, (3, 3) rows: scene = A·device, for the hands' velocities.
    """

    pairing: str = "release"
    namespace: str = ""
    frame: str = FRAME
    scene_unit: float = number(25.0, 0.0, 1e6, "µm", open_low=True)
    force_unit: float = number(1.0, 0.0, 1e12, "pN", open_low=True)
    communication_rate: float = number(60.0, 0.1, 1000.0, "Hz")
    control_rate: float = number(5.0, 0.1, 1000.0, "Hz")
    timeout: float = number(0.5, 0.0, 60.0, "s", open_low=True)
    hand_timeout: float = number(0.1, 0.0, 60.0, "s", open_low=True)
    speed_limit: float = number(30.0, 0.0, 1e6, "scene units/s", open_low=True)
    turn_limit: float = number(500.0, 0.0, 1e6, "deg/s", open_low=True)
    hand_speed_limit: float = number(2000.0, 0.0, 1e6, "mm/s", open_low=True)
    motion_gain: float = number(100.0, 0.0, 1e9, "µm/m", open_low=True)
    axis_map: Matrix = FACING_USER

    def __post_init__(self) -> None:
        check_fields(self, "ros2")
        check_orthogonal(self.axis_map)
        if self.pairing not in PAIRINGS:
            raise InputError(f"ros2.pairing is {self.pairing!r}; allowed: {', '.join(PAIRINGS)}")
        if self.namespace:
            resolve_topic(self.namespace)
        if self.timeout * self.control_rate < FEWEST_PERIODS:
            raise InputError(
                f"ros2.timeout is {self.timeout!r}; allowed: {FEWEST_PERIODS / self.control_rate:g} to 60 s, "
                f"a period of control or more"
            )

    def topic(self, name: str) -> str:
        """Full name of a topic, with the namespace before it."""
        inner = resolve_topic(name)
        return resolve_topic(self.namespace) + inner if self.namespace else inner


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
    """Publishes the states of a scene and collects commands.

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
        topics = (*SIMULATOR_TOPICS, CELL_TOPIC, *HIT_TOPICS)
        self._out = {topic: node.publisher(config.topic(topic), self._m.TFMessage, RELIABLE) for topic in topics}
        twist = self._m.Twist
        self._velocity_in = node.subscribe(config.topic(VELOCITY_TOPIC), twist, SENSOR_DATA)
        self._reset_in = node.subscribe(config.topic(RESET_TOPIC), twist, SENSOR_DATA)
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

    def publish(self, now: float, state: TopicState) -> bool:
        """Send the state, at most `communication_rate` times a second; never waits.

        Args:
            now: On the loop's clock [s].
            state: What the topics say: where the groups hold, the robots, `/xform` halfway between them and
                turned along the pair, `/object` where there is a cell. Without a time its stamps are `now`.

        Returns:
            Whether it was time to send.

        Raises:
            InputError: A number that is not finite or too large, an empty group, too many obstacles; nothing is sent.
        """
        _check_now(now)
        period = 1.0 / self.config.communication_rate
        if self._due - period <= now < self._due:
            return False
        stamp = self._stamp(now if state.time is None else state.time)
        # all are made before any is sent: a bad number anywhere sends nothing
        made = [(topic, self._message(stamp, topic, p, q, unit)) for topic, p, q, unit in self._transforms(state)]
        for topic, message in made:
            self._out[topic].publish(message)
        # on the grid of the rate; after a pause, or a clock that went back, a new grid and no burst
        self._due = self._due + period if 0.0 <= now - self._due < period else now + period
        return True

    def _transforms(self, state: TopicState) -> Iterator[tuple[str, Vec3, Quat, float]]:
        """Topic, position, rotation and unit of length of each message."""
        unit, force = self.config.scene_unit, self.config.force_unit
        most = max(len(state.obstacles), len(state.hits))
        if most > len(OBSTACLE_TOPICS):
            raise InputError(f"obstacles are {most}; allowed: up to {len(OBSTACLE_TOPICS)}")
        if not all(len(group) for group in state.traps):
            raise InputError("traps has an empty group; allowed: one trap or more in each")
        for topic, point in zip(TRAP_TOPICS, state.trap_points, strict=True):
            yield topic, point, UPRIGHT, unit
        for topic, (position, rotation) in zip(ROBOT_TOPICS, state.robots, strict=True):
            yield topic, position, rotation, unit
        (first, _), (second, _) = state.robots
        yield PAIR_TOPIC, midpoint(first, second), pair_yaw(first, second), unit
        for topic, (position, rotation) in zip(OBSTACLE_TOPICS, state.obstacles, strict=False):
            yield topic, position, rotation, unit
        if state.cell is not None:
            held, hit = float(not state.cell_lost), float(state.collision)
            yield CELL_TOPIC, state.cell, (state.contact_force / force, held, hit, state.collision_force / force), unit
        for topic, (hit, strength) in zip(HIT_TOPICS, state.hits, strict=False):
            yield topic, (float(hit), strength / force, 0.0), UPRIGHT, 1.0

    def _stamp(self, time: float) -> Any:
        """Time as ROS 2 has it."""
        if not 0.0 <= time < LAST_SECOND:
            raise InputError(f"time is {time!r}; allowed: 0 to {LAST_SECOND:.0f} s")
        seconds = math.floor(time)
        return self._m.Time(seconds, min(int((time - seconds) * 1e9), 999_999_999))

    def _message(self, stamp: Any, topic: str, position: Vec3, rotation: Quat, unit: float) -> Any:
        """One transform, its lengths in scene units."""
        name = topic.strip("/")
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
