"""Configuration of the haptic chain: every number that shapes a force, with its range; and presets to start from.

Device side in SI units, scene side in µm and pN; the two gains carry the units across. A configuration is stored with
a recording. The presets are the Touch in our chain, the chain of the public release
`Zongcai23/ot-haptic-feedback-digital-twin`, and its pairings of the hands: what they name (topics, namespaces, which
trap and robot) is its contract; the gains of our own chain are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from otwarp.errors import InputError
from otwarp.haptics.core.fields import Matrix, check_fields, check_value, number

Hand = Literal["left", "right"]

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

FACING_USER: Matrix = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
"""Device axes x right, y up, z towards the user (OpenHaptics) to the scene's x right, y away, z up along the beam."""

ORTHOGONAL = 1e-6
"""Largest entry of A·Aᵀ − 1 that still counts as a rotation: a matrix typed with seven digits passes."""


RATES = (1.0, 20_000.0)
"""Allowed rates of a filter or a servo [Hz]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LowPass:
    """y += α(x − y), once per sample at `rate`.

    An α without its rate means nothing: 0.05 is 19.5 ms at 1 kHz and 162 ms at 120 Hz. τ = −T/ln(1 − α), T = 1/rate.

    Attributes:
        alpha: Share of the new sample, above 0 to 1; 1 filters nothing.
        rate: Samples per second [Hz].

    Raises:
        InputError: α or rate out of range.
    """

    alpha: float = number(None, 0.0, 1.0, "", open_low=True)
    rate: float = number(None, *RATES, "Hz")

    def __post_init__(self) -> None:
        check_fields(self, "filter")

    @classmethod
    def of_time_constant(cls, time_constant: float, rate: float) -> LowPass:
        """The filter with this τ [s] at this rate [Hz].

        Raises:
            InputError: τ negative or not finite, or so long that α vanishes.
        """
        if not 0.0 <= time_constant < math.inf:
            raise InputError(f"filter time constant is {time_constant!r}; allowed: 0 or more, finite [s]")
        alpha = 1.0 if time_constant == 0.0 else -math.expm1(-1.0 / (rate * time_constant))
        return cls(alpha=alpha, rate=rate)

    @property
    def time_constant(self) -> float:
        """τ [s]; 0 for α = 1."""
        return 0.0 if self.alpha == 1.0 else -1.0 / (self.rate * math.log1p(-self.alpha))

    def at(self, rate: float) -> LowPass:
        """The filter of the same τ at another rate [Hz]."""
        return LowPass.of_time_constant(self.time_constant, rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class CouplingConfig:
    """Virtual coupling: a spring and a damper in series between the hand and the traps.

    Attributes:
        stiffness: The largest that the hand can feel at rest [N/m].
        damping: Of the coupling [N·s/m]; bounds the stiffness felt at high frequency to damping/T.
    """

    stiffness: float = number(500.0, 0.0, 1e6, "N/m", open_low=True)
    damping: float = number(2.0, 0.0, 1e3, "N·s/m", open_low=True)

    def __post_init__(self) -> None:
        check_fields(self, "coupling")


@dataclass(frozen=True, slots=True, kw_only=True)
class PassivityConfig:
    """Passivity control, see `otwarp.haptics.chain.passivity.Passivity`.

    Attributes:
        reserve: Energy that the chain may give before it must have taken any [J]; the ε of its passivity.
        capacity: Most energy that is remembered as taken [J]; more is forgotten, on the safe side.
        share: Part of the energy at hand that one servo period may give back; below 1 the end of it is approached
            smoothly.
        damping_limit: Largest damping used to win back energy [N·s/m]. A sampled damper acts on the velocity of the
            last period and so destabilizes a mass m from 2m/T on; default: a tenth of that for 0.15 kg at 1 kHz.
        speed: Fastest that the hand moves [m/s].
        acceleration: Most that it speeds up or turns with [m/s²]; one that was seen to do more is expected to reach
            `speed` at once. The default is five times g.
        hold: Shortest time for which a force is expected to be held [s]; the longest of the last seconds counts if it
            is longer. 0.1 bounds the energy for every schedule of cycles, the first late one included, and leaves
            nearly no force.
        noise: Largest error of the device's position that differs from sample to sample [m].
    """

    reserve: float = number(1e-4, 0.0, 1.0, "J")
    capacity: float = number(0.2, 0.0, 10.0, "J", open_low=True)
    share: float = number(0.25, 0.0, 1.0, "", open_low=True)
    damping_limit: float = number(30.0, 0.0, 1e3, "N·s/m")
    speed: float = number(0.5, 0.0, 100.0, "m/s", open_low=True)
    acceleration: float = number(50.0, 0.0, math.inf, "m/s²", open_low=True)
    hold: float = number(0.0, 0.0, 0.1, "s")
    noise: float = number(1e-7, 0.0, 1e-2, "m")

    def __post_init__(self) -> None:
        check_fields(self, "passivity")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainConfig:
    """From the hand's motion to the force that safety is handed.

    Attributes:
        rate: Servo rate [Hz].
        mode: `stable`, ours: the force is computed each period from the fresh hand position. `paper`: the public
            release's, filtered per message.
        motion_filter: Of the motion that the traps are commanded; the force does not wait for it. None filters nothing.
        force_filter: Of the force; it delays, so that b/τ bounds the stiffness that passivity control need not touch.
        pose_filter: Of the sphere positions, which arrive at the simulation's rate, not the servo's.
        pose_prediction: Whether spheres follow the hand between two published states as they did before, see
            `force.LocalModel`;
            stable mode only, for the release does not.
        damping: Virtual damping of the hand [N·s/m]; in paper mode that of the release's device node.
        distance_damping: The release's D [raw force·s/µm], paper mode only; it ships 0.
        coupling: Virtual coupling, or None.
        passivity: Passivity control, or None.
        quantum: Resolution of the device's position, the noise margin of the velocity estimate [m]; 0 for none.
        trap_speed: Fastest that a hand moves its traps [µm/s], inf for no limit.
        messages_per_state: Force-filter updates that one published state makes in paper mode: the release filters on
            the trap's message and again on the robot's.
    """

    rate: float = number(1000.0, 100.0, RATES[1], "Hz")
    mode: Literal["stable", "paper"] = "stable"
    motion_filter: LowPass | None = None
    force_filter: LowPass | None = None
    pose_filter: LowPass | None = None
    pose_prediction: bool = False
    damping: float = number(0.0, 0.0, 100.0, "N·s/m")
    distance_damping: float = number(0.0, 0.0, 1e6, "pN·s/µm")
    coupling: CouplingConfig | None = None
    passivity: PassivityConfig | None = PassivityConfig()
    quantum: float = number(0.0, 0.0, 1e-2, "m")
    trap_speed: float = number(math.inf, 0.0, math.inf, "µm/s", open_low=True)
    messages_per_state: int = number(2, 1, 2, "")

    def __post_init__(self) -> None:
        check_fields(self, "chain")


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyConfig:
    """What stands between the chain and the motors.

    Attributes:
        ramp_time: Time from armed to full force [s].
        slew: Fastest change of the force [N/s].
        clamp: Largest force [N].
        continuous_force: Root mean square force that the motors bear for ever [N].
        thermal_time: Time constant over which the mean is taken [s].
        decay_after: Age of the newest state, or of the device's newest word, at which the force begins to fall [s].
        disarm_after: Age at which it is zero and the hand disarmed [s].
        dead_man: Whether force and motion need button 0 held.

    Raises:
        InputError: A value out of range, or a slew limit too low to reach zero between the two ages.
    """

    ramp_time: float = number(0.5, 0.0, 10.0, "s")
    slew: float = number(1000.0, 0.0, 1e6, "N/s", open_low=True)
    clamp: float = number(3.3, 0.0, 100.0, "N")
    continuous_force: float = number(0.88, 0.0, 100.0, "N")
    thermal_time: float = number(10.0, 0.01, 1e4, "s")
    decay_after: float = number(0.020, 0.001, 1.0, "s")
    disarm_after: float = number(0.100, 0.002, 2.0, "s")
    dead_man: bool = False

    def __post_init__(self) -> None:
        check_fields(self, "safety")
        if self.disarm_after <= self.decay_after:
            allowed = f"above decay_after, {self.decay_after:g} s"
            raise InputError(f"safety.disarm_after is {self.disarm_after!r}; allowed: {allowed}")
        least = 2.0 * self.clamp / (self.disarm_after - self.decay_after)
        if self.slew < least:
            raise InputError(
                f"safety.slew is {self.slew!r}; allowed: {least:g} N/s or more, to reach zero before it disarms"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class HandConfig:
    """One side: the traps that the operator's hand moves, how far, and how hard it is pushed back.

    Attributes:
        name: `left` or `right`.
        traps: Indices of the traps it moves.
        motion_gain: Of the paper's G_control [µm of trap per m of hand].
        force_gain: Of the paper's G_hand [N on the hand per pN in the scene].
        axis_map: A, (3, 3) rows: scene = A·device. A rotation or a signed permutation.
        clutch: Whether button 1 lets go of the traps while it is held.
        absolute: Whether a trap follows the place of the hand, measured from where it was when it took hold, instead of
            adding up its motions. Letting go of the clutch then brings the traps to the hand at once, and the traps'
            speed limit is left to the simulation.
        chain, safety: Their own.
    """

    name: Literal["left", "right"] = "right"
    traps: tuple[int, ...] = ()
    motion_gain: float = number(100.0, 0.0, 1e9, "µm/m", open_low=True)
    force_gain: float = number(0.05, 0.0, 1e6, "N/pN")
    axis_map: Matrix = FACING_USER
    clutch: bool = True
    absolute: bool = False
    chain: ChainConfig = ChainConfig()
    safety: SafetyConfig = SafetyConfig()

    def __post_init__(self) -> None:
        check_fields(self, "hand")
        check_orthogonal(self.axis_map)
        if len(set(self.traps)) != len(self.traps):
            raise InputError(f"hand.traps is {self.traps!r}; allowed: each trap once")


Gains = tuple[float | None, float | None]
"""Motion gain [µm/m] and force gain [N/pN]; None for as configured."""


def checked_gains(motion_gain: float | None, force_gain: float | None) -> Gains:
    """Gains within the ranges of `HandConfig`.

    Raises:
        InputError: Out of range.
    """
    fields = HandConfig.__dataclass_fields__
    for name, value in (("motion_gain", motion_gain), ("force_gain", force_gain)):
        if value is not None:
            check_value(f"hand.{name}", value, float, fields[name].metadata)
    return motion_gain, force_gain


@dataclass(frozen=True, slots=True, kw_only=True)
class HapticsConfig:
    """All sides of a session; no trap is in two of them.

    Raises:
        InputError: Two hands of one name, or a trap in two hands.
    """

    hands: tuple[HandConfig, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, "haptics")
        names = [hand.name for hand in self.hands]
        if len(set(names)) != len(names):
            raise InputError(f"haptics.hands is {', '.join(names)}; allowed: each hand once")
        traps = [trap for hand in self.hands for trap in hand.traps]
        twice = sorted({trap for trap in traps if traps.count(trap) > 1})
        if twice:
            raise InputError(f"haptics.hands has trap {twice[0]} in two hands; allowed: each trap in one")


def check_orthogonal(a: Matrix) -> None:
    """Refuse an axis map that would stretch or shear."""
    for i in range(3):
        for j in range(3):
            product = sum(a[i][k] * a[j][k] for k in range(3))
            if not abs(product - (i == j)) <= ORTHOGONAL:
                raise InputError(f"hand.axis_map is {a!r}; allowed: a rotation or a signed permutation")


RELEASE_GAIN = 0.0022
"""G_hand as the release ships it [N per raw unit]; the paper's range is 0.0022 to 0.0030."""

RELEASE_ALPHA = 0.05
"""α of both of the release's filters, per message."""

RELEASE_RATE = 60.0
"""Rate of each of the simulator's topics [Hz]; the force filter runs on two of them."""

TOUCH_MASS, TOUCH_DAMPING = 0.15, 0.2
"""Apparent mass [kg] and damping [N·s/m] of a bare Touch that all Z-widths here are stated for; assumed, not measured
by us."""

TOUCH_SAFETY = SafetyConfig(clamp=3.3, continuous_force=0.88)
"""The Touch (formerly Phantom Omni): 3.3 N at most, 0.88 N for ever, the figures that its maker's data sheet is cited
for; we had no copy of the sheet, and found only the 3.3 N confirmed elsewhere. Its thermal time is not published; 10 s
is a guess on the cautious side."""

TOUCH_QUANTUM = 5.5e-5
"""Nominal resolution of the Touch's position [m]: 450 dpi, 25.4 mm/450 = 0.056 mm, cited as 0.055 mm; as above, not
checked against the sheet."""

TOUCH_CHAIN = ChainConfig(passivity=PassivityConfig(), quantum=TOUCH_QUANTUM, pose_prediction=True)
"""Our chain for the Touch: nothing filtered, passivity controlled, velocity estimated within the encoder's noise,
spheres predicted between states."""

PAPER_CHAIN = ChainConfig(
    mode="paper",
    motion_filter=LowPass(alpha=RELEASE_ALPHA, rate=1000.0),
    force_filter=LowPass(alpha=RELEASE_ALPHA, rate=2.0 * RELEASE_RATE),
    damping=1.0,
    passivity=None,
)
"""The release's chain: α = 0.05 on the hand's velocity per device message, 0.05 on the force per trap and per robot
message, D = 0, and the device node's 0.001 N per mm/s. Safety still applies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """One hand's end of a pairing.

    Attributes:
        namespace: Of its topics.
        group: Which trap and robot: 0 for `/firstOTposition` and `/robot01`, 1 for `/secondOTposition`, `/robot02`.
        smoothed_twist: Name of the topic of its smoothed velocity.
    """

    namespace: str
    group: int
    smoothed_twist: str


PAIRINGS: dict[str, dict[Hand, Side]] = {
    "release": {
        "left": Side(namespace="/GeomagicLeft", group=0, smoothed_twist="smoothed_twist"),
        "right": Side(namespace="/GeomagicRight", group=1, smoothed_twist="smoothed_twist"),
    },
    "older": {
        "left": Side(namespace="/Geomagic", group=1, smoothed_twist="smoothedTwist"),
        "right": Side(namespace="/Geomagic2", group=0, smoothed_twist="smoothedTwist"),
    },
}
"""Published pairings. The older release pairs the hands the other way round; that its `/Geomagic` is the left hand is
our reading."""


def two_hands(
    first: tuple[int, ...], second: tuple[int, ...], *, pairing: str = "release", mode: str = "stable"
) -> HapticsConfig:
    """Two Touches that move two groups of traps.

    Args:
        first, second: Traps of the group that the release calls first, and second.
        pairing: Key of `PAIRINGS`.
        mode: `stable` or `paper`.

    Raises:
        InputError: An unknown pairing or mode, or a trap in both groups.
    """
    if pairing not in PAIRINGS:
        raise InputError(f"pairing is {pairing!r}; allowed: {', '.join(PAIRINGS)}")
    if mode not in ("stable", "paper"):
        raise InputError(f"chain.mode is {mode!r}; allowed: stable, paper")
    base = HandConfig(chain=TOUCH_CHAIN, safety=TOUCH_SAFETY)
    if mode == "paper":
        base = replace(base, chain=PAPER_CHAIN, force_gain=RELEASE_GAIN)
    sides = PAIRINGS[pairing]
    return HapticsConfig(
        hands=tuple(replace(base, name=hand, traps=(first, second)[side.group]) for hand, side in sides.items())
    )
