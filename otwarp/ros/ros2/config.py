"""Configuration of the ROS 2 bridge: units, rates, limits and names, typed and with their ranges."""

from __future__ import annotations

from dataclasses import dataclass

from otwarp.errors import InputError
from otwarp.haptics.core.config import FACING_USER, check_orthogonal
from otwarp.haptics.core.fields import Matrix, check_fields, number
from otwarp.haptics.core.presets import PAIRINGS
from otwarp.ros.ros2.names import resolve_topic

FEWEST_PERIODS = 1.0
"""A timeout below one period of control would stop the pair between any two commands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ros2Config:
    """What the bridge says and hears, and in which units.

    Attributes:
        pairing: Key of `otwarp.haptics.core.presets.PAIRINGS`: names and sides of the hands' topics.
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
    frame: str = "world"
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
