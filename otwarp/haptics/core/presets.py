"""Configurations to start from: the Touch in our chain, the release's chain, and both published pairings of the hands.

What a pairing names (topics, namespaces, which trap and robot) is the contract of the public release
`Zongcai23/ot-haptic-feedback-digital-twin`; the gains of our own chain are ours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from otwarp.errors import InputError
from otwarp.haptics.chain.paper_mode import RELEASE_ALPHA, RELEASE_GAIN, RELEASE_RATE
from otwarp.haptics.core.config import ChainConfig, HandConfig, HapticsConfig, LowPass, PassivityConfig, SafetyConfig

Hand = Literal["left", "right"]

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
