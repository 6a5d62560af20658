"""The paper's topics: names, types, rates, units, what they say of a moment, and the way between its units and ours.

After the public release `Zongcai23/ot-haptic-feedback-digital-twin` (its launch files, `force_pub.py` and tutorial 3).
Its simulator publishes positions in scene units; its device nodes publish millimetres and mm/s in the device's axes;
its force node takes the difference of two published positions for the direction of the force, which the device node
renders as it comes. So the published axes must be the device's for the force to pull the right way: `axis_map` turns
them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from otwarp.errors import InputError
from otwarp.haptics.core import Vec3
from otwarp.haptics.core.config import FACING_USER, PAIRINGS, Hand, check_orthogonal
from otwarp.haptics.core.fields import Matrix, check_fields, number
from otwarp.ros.motion import Group, centroid

Quat = tuple[float, float, float, float]
"""Orientation as a unit quaternion x, y, z, w."""
Pose = tuple[Vec3, Quat]
"""Position [µm, or scene units where published] and orientation."""
UPRIGHT: Quat = (0.0, 0.0, 0.0, 1.0)

TRAP_TOPICS = ("/firstOTposition", "/secondOTposition")
"""Trap of each group."""
ROBOT_TOPICS = ("/robot01", "/robot02")
"""Robot of each group."""
PAIR_TOPIC = "/xform"
"""Midpoint of the two robots."""
OBSTACLE_TOPICS = ("/DynaOb01", "/DynaOb02", "/DynaOb03", "/DynaOb04")
"""Moving obstacles."""
SIMULATOR_TOPICS = (*TRAP_TOPICS, *ROBOT_TOPICS, PAIR_TOPIC, *OBSTACLE_TOPICS)
"""What the release's simulator publishes."""
CELL_TOPIC = "/object"
"""The cell, and in its rotation contact force, whether it is held, and collisions; of the RL companion alone."""
HIT_TOPICS = tuple(f"{topic}Collide" for topic in OBSTACLE_TOPICS)
"""Whether an obstacle is hit, and how hard; of the RL companion alone."""
VELOCITY_TOPIC, RESET_TOPIC = "/rl_vel", "/resetSignal"
"""What the RL companion asks for: a planar velocity of the pair, a new trial."""

FRAME = "world"
"""Frame of poses and transforms."""

TRANSFORM = "tf2_msgs/TFMessage"
"""Type of all that the simulator publishes, with exactly one transform each."""
HAND_TYPES = {
    "twist": "geometry_msgs/Twist",
    "smoothed_twist": "geometry_msgs/Twist",
    "pose": "geometry_msgs/PoseStamped",
    "joint_states": "sensor_msgs/JointState",
    "joy": "sensor_msgs/Joy",
    "button": "geomagic_control/DeviceButtonEvent",
    "force_feedback": "geomagic_control/DeviceFeedback",
}
"""Topics below a device's namespace, and their types; the last is consumed by the device, the others published."""

RATE = 60.0
"""Of the simulator's topics [Hz]."""
PROPER = 1e-6
"""Largest distance from 1 of the determinant of a rotation typed with seven digits."""


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TopicState:
    """What the topics say of one moment.

    Attributes:
        traps: Foci of the first and of the second group (n, 3), n ≥ 1 [µm].
        robots: Poses of the first and of the second robot.
        rests: Where the light of each group holds its robot, which is what the trap topics say [µm]; None says the
            foci's means.
        cell: Its centre [µm], None without one.
        obstacles: Poses of those that move, four at most.
        contact_force: Sum of the normal forces on the cell [pN].
        cell_lost: Whether the pair has lost the cell.
        collision: Whether the cell or a robot has hit an obstacle.
        collision_force: How hard [pN].
        hits: For each obstacle whether it is hit, and how hard [pN].
        time: Simulated [s], for the stamps; None where only the publisher's clock is known.
    """

    traps: tuple[Group, Group]
    robots: tuple[Pose, Pose]
    rests: tuple[Vec3, Vec3] | None = None
    cell: Vec3 | None = None
    obstacles: Sequence[Pose] = ()
    contact_force: float = 0.0
    cell_lost: bool = False
    collision: bool = False
    collision_force: float = 0.0
    hits: Sequence[tuple[bool, float]] = ()
    time: float | None = None

    @property
    def trap_points(self) -> tuple[Vec3, Vec3]:
        """What the trap topics say of each group [µm]."""
        return self.rests or (centroid(self.traps[0]), centroid(self.traps[1]))


@dataclass(frozen=True, slots=True)
class HandTopics:
    """One hand's end of the contract.

    Attributes:
        hand: `left` or `right`.
        group: Which trap and robot it has: 0 or 1.
        namespace: Of its device.
        smoothed_twist: Topic of the velocity that the simulator integrates.
    """

    hand: Hand
    group: int
    namespace: str
    smoothed_twist: str

    def topic(self, name: str) -> str:
        """Full name of one of `HAND_TYPES`."""
        return self.smoothed_twist if name == "smoothed_twist" else f"{self.namespace}/{name}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ContractConfig:
    """What is configuration in the contract.

    Attributes:
        pairing: Key of `PAIRINGS`: which hand has which group, and the names of its topics.
        namespaces: Of the left and of the right device, instead of the pairing's.
        rate: Of the simulator's topics [Hz].
        scene_unit: What the release calls 1 [µm]. Its figures say roughly 15 to 35; that is all that is known.
        motion_gain: G_control [scene units of trap per mm of hand]; the release's is not published. The default makes
            100 µm per metre, as `HandConfig` does.
        axis_map: A, (3, 3) rows: scene = A·published, a proper rotation.
        twist_timeout: How long a velocity holds without a newer one [s]; then the traps stand still.

    Raises:
        InputError: A value out of range, an unknown pairing, or an axis map that is no rotation.
    """

    pairing: str = "release"
    namespaces: tuple[str, ...] = ()
    rate: float = number(RATE, 1.0, 1000.0, "Hz")
    scene_unit: float = number(25.0, 0.0, 1e6, "µm", open_low=True)
    motion_gain: float = number(0.004, 0.0, 1e6, "scene units/mm", open_low=True)
    axis_map: Matrix = FACING_USER
    twist_timeout: float = number(0.1, 0.0, 10.0, "s", open_low=True)

    def __post_init__(self) -> None:
        check_fields(self, "contract")
        check_orthogonal(self.axis_map)
        (a, b, c), (d, e, f), (g, h, i) = self.axis_map
        if not abs(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) - 1.0) <= PROPER:
            raise InputError(f"contract.axis_map is {self.axis_map!r}; allowed: a rotation without reflection")
        if self.pairing not in PAIRINGS:
            raise InputError(f"contract.pairing is {self.pairing!r}; allowed: {', '.join(PAIRINGS)}")
        different = len({name.strip("/") for name in self.namespaces}) == len(self.namespaces)
        if len(self.namespaces) not in (0, 2) or not different or not all(n.strip("/") for n in self.namespaces):
            given = ",".join(self.namespaces)
            raise InputError(f"namespaces is {given!r}; allowed: none, or two different ones, of the left device first")

    def hands(self) -> tuple[HandTopics, HandTopics]:
        """Topics of the left and of the right hand."""
        left, right = (self._hand(hand, n) for n, hand in enumerate(("left", "right")))
        return left, right

    def _hand(self, hand: Hand, n: int) -> HandTopics:
        side = PAIRINGS[self.pairing][hand]
        namespace = "/" + (self.namespaces[n] if self.namespaces else side.namespace).strip("/")
        return HandTopics(hand, side.group, namespace, f"{namespace}/{side.smoothed_twist}")


class Axes:
    """The way between the scene (µm, its axes) and what is published (scene units, `axis_map`).

    Args:
        config: Says both.
    """

    __slots__ = ("_a", "_gain", "_turn", "_unit")

    def __init__(self, config: ContractConfig) -> None:
        self._a, self._unit = config.axis_map, config.scene_unit
        self._gain = config.motion_gain * config.scene_unit
        self._turn = _conjugate(quaternion(config.axis_map))

    def point(self, position: Sequence[float]) -> Vec3:
        """Published position of a place in the scene [µm]: Aᵀ·p / scene unit."""
        a, (x, y, z), k = self._a, position, 1.0 / self._unit
        return (
            float(k * (a[0][0] * x + a[1][0] * y + a[2][0] * z)),
            float(k * (a[0][1] * x + a[1][1] * y + a[2][1] * z)),
            float(k * (a[0][2] * x + a[1][2] * y + a[2][2] * z)),
        )

    def orientation(self, orientation: Sequence[float]) -> Quat:
        """Published orientation (x, y, z, w) of a body in the scene: its own axes stay, the world's turn."""
        x, y, z, w = (float(c) for c in orientation)
        return product(self._turn, (x, y, z, w))

    def pose(self, pose: tuple[Sequence[float], Sequence[float]]) -> Pose:
        """Published pose of a body in the scene."""
        return self.point(pose[0]), self.orientation(pose[1])

    def motion(self, moved: Sequence[float]) -> Vec3:
        """Displacement in the scene [µm] for one of a hand [mm] in published axes: G_control·scene unit·A·Δ."""
        a, (x, y, z), k = self._a, moved, self._gain
        u, v, w = (k * (row[0] * x + row[1] * y + row[2] * z) for row in a)
        return (u, v, w)


def quaternion(a: Matrix) -> Quat:
    """Unit quaternion (x, y, z, w) of a proper rotation, by its largest component."""
    trace = a[0][0] + a[1][1] + a[2][2]
    squares = (1.0 + 2.0 * a[0][0] - trace, 1.0 + 2.0 * a[1][1] - trace, 1.0 + 2.0 * a[2][2] - trace, 1.0 + trace)
    k = squares.index(max(squares))
    big = math.sqrt(squares[k])
    off = ((a[2][1] - a[1][2]), (a[0][2] - a[2][0]), (a[1][0] - a[0][1]))
    if k == 3:
        x, y, z, w = (*(o / big for o in off), big)
    else:
        parts = [(a[k][j] + a[j][k]) / big for j in range(3)]
        parts[k] = big
        (x, y, z), w = parts, off[k] / big
    return (0.5 * x, 0.5 * y, 0.5 * z, 0.5 * w)


def product(p: Quat, q: Quat) -> Quat:
    """p·q, of quaternions (x, y, z, w): the rotation q, then p."""
    (a, b, c, d), (x, y, z, w) = p, q
    return (
        d * x + a * w + b * z - c * y,
        d * y - a * z + b * w + c * x,
        d * z + a * y - b * x + c * w,
        d * w - a * x - b * y - c * z,
    )


def _conjugate(q: Quat) -> Quat:
    return (-q[0], -q[1], -q[2], q[3])
