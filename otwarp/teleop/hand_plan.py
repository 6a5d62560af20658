"""Which hand moves which traps, how, and with what device: the scene's word, the user's, and a configuration file's."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from otwarp.errors import InputError
from otwarp.haptics.config import HandConfig, HapticsConfig, from_dict
from otwarp.haptics.presets import two_hands
from otwarp.scene.description import Scene
from otwarp.teleop.frame import HANDS


@dataclass(frozen=True, slots=True)
class HandPlan:
    """One hand of a session.

    Attributes:
        device: As the user named it.
        config: With the traps that it moves.
    """

    device: str
    config: HandConfig

    @property
    def name(self) -> str:
        """`left` or `right`."""
        return self.config.name


def traps_of(scene: Scene, hand: str) -> tuple[int, ...]:
    """Indices of the traps whose `ot:trap:hand` is this hand."""
    return tuple(n for n, trap in enumerate(scene.traps) if trap.hand == hand)


def plan_hands(
    scene: Scene,
    devices: Mapping[str, str],
    *,
    config: HapticsConfig | None = None,
    mode: str = "stable",
    pairing: str = "release",
    motion_gain: float | None = None,
    force_gain: float | None = None,
    rate: float | None = None,
) -> tuple[HandPlan, ...]:
    """The hands of a session, left before right.

    Args:
        scene: Whose `ot:trap:hand` says which hand moves a trap, unless `config` does.
        devices: Hand → device; a hand without one moves nothing.
        config: Replaces the presets; a hand in it without traps takes the scene's.
        mode, pairing: As `presets.two_hands`; only without `config`. The older pairing swaps the hands' traps.
        motion_gain, force_gain: Replace those of both hands [µm/m, N/pN].
        rate: Servo rate [Hz].

    Raises:
        InputError: A hand without a trap, a trap that the scene lacks, a number out of range.
    """
    for hand in devices:
        if hand not in HANDS:
            raise InputError(f"hand is {hand!r}; allowed: {', '.join(HANDS)}")
    if config is None:
        # the release's first group is its left hand's
        config = two_hands(traps_of(scene, "left"), traps_of(scene, "right"), pairing=pairing, mode=mode)
    configured = {hand.name: hand for hand in config.hands}
    plans = []
    for hand in (h for h in HANDS if h in devices):
        if hand not in configured:
            raise InputError(f"--{hand} is {devices[hand]!r}; allowed: hands of the configuration, {list(configured)}")
        one = configured[hand]
        if not one.traps:
            one = replace(one, traps=traps_of(scene, hand))
        plans.append(HandPlan(devices[hand], _tuned(scene, one, motion_gain, force_gain, rate)))
    HapticsConfig(hands=tuple(plan.config for plan in plans))  # refuses a trap in two hands
    return tuple(plans)


def _tuned(
    scene: Scene, hand: HandConfig, motion_gain: float | None, force_gain: float | None, rate: float | None
) -> HandConfig:
    """A hand with the user's gains, and no faster than its traps may move."""
    where = scene.file or scene.root
    if not hand.traps:
        raise InputError(f"{where}: no trap has ot:trap:hand = {hand.name!r}; allowed: a hand that moves a trap")
    missing = [t for t in hand.traps if t >= len(scene.traps)]
    if missing:
        raise InputError(f"hand.traps has {missing[0]}; allowed: traps of {where}, 0 to {len(scene.traps) - 1}")
    limit = min((scene.traps[t].speed_limit for t in hand.traps), default=math.inf)
    chain = replace(hand.chain, trap_speed=min(hand.chain.trap_speed, limit), rate=rate or hand.chain.rate)
    gains = {"motion_gain": motion_gain, "force_gain": force_gain}
    return replace(hand, chain=chain, **{k: float(v) for k, v in gains.items() if v is not None})


def load_config(file: str | Path) -> HapticsConfig:
    """A configuration from a JSON file, as `haptics.config.to_dict` writes it; what is left out keeps its default.

    Raises:
        InputError: The file cannot be read, or a key or value in it cannot be.
    """
    try:
        text = Path(file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"--config {file}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    try:
        data = json.loads(text)
    except ValueError as error:
        raise InputError(f"--config {file}: is not JSON ({error})") from None
    return from_dict(HapticsConfig, data)
