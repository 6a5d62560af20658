"""Which hand moves which traps, how, and with what device: the scene's word, the user's, and a configuration file's."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.core.config import HandConfig, HapticsConfig
from otwarp.haptics.core.fields import from_dict, to_dict
from otwarp.haptics.core.presets import two_hands
from otwarp.scene import Scene
from otwarp.teleop.core.frame import HANDS


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
    config: HapticsConfig | Mapping[str, Any] | None = None,
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
        config: Replaces the presets, or, as a mapping, changes them; a hand in it without traps takes the scene's.
        mode, pairing: Of the presets, as `presets.two_hands`. The older pairing swaps the hands' traps.
        motion_gain, force_gain: Replace those of both hands [µm/m, N/pN].
        rate: Servo rate [Hz].

    Raises:
        InputError: A hand without a trap, a trap that the scene lacks, a number out of range.
    """
    for hand in devices:
        if hand not in HANDS:
            raise InputError(f"hand is {hand!r}; allowed: {', '.join(HANDS)}")
    if not isinstance(config, HapticsConfig):
        # the release's first group is its left hand's
        preset = two_hands(traps_of(scene, "left"), traps_of(scene, "right"), pairing=pairing, mode=mode)
        config = preset if config is None else changed(preset, config)
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


def slowed(plans: tuple[HandPlan, ...], speed: float) -> tuple[HandPlan, ...]:
    """Plans for a session in slow motion: a trap's limit is per simulated second, a hand's per second of the clock."""
    factor = min(speed, 1.0)
    return tuple(
        replace(plan, config=replace(plan.config, chain=replace(chain, trap_speed=chain.trap_speed * factor)))
        for plan in plans
        for chain in (plan.config.chain,)
    )


def changed(preset: HapticsConfig, changes: Mapping[str, Any]) -> HapticsConfig:
    """A preset with what a mapping says otherwise; hands go by their names.

    Raises:
        InputError: A key or value that cannot be, or a hand without a name.
    """
    plain = to_dict(preset)
    hands = {hand["name"]: hand for hand in plain["hands"]}
    asked = changes.get("hands", [])
    if not isinstance(asked, list) or not all(isinstance(hand, Mapping) for hand in asked):
        raise InputError(f"hands is {asked!r}; allowed: a list of hands")
    for hand in asked:
        if hand.get("name") not in hands:
            raise InputError(f"hands has one of name {hand.get('name')!r}; allowed: {', '.join(hands)}")
        hands[hand["name"]] = _merged(hands[hand["name"]], hand)
    return from_dict(HapticsConfig, {**plain, **changes, "hands": list(hands.values())})


def _merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Nested keys of `changes` over those of `base`."""
    out = dict(base)
    for key, value in changes.items():
        both = isinstance(value, Mapping) and isinstance(out.get(key), Mapping)
        out[key] = _merged(out[key], value) if both else value
    return out


def load_config(file: str | Path) -> Mapping[str, Any]:
    """What a JSON file changes of the presets; `otwarp haptics config` prints one with all keys.

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
    try:
        if not isinstance(data, Mapping):
            raise InputError(
                f"it holds {type(data).__name__}; allowed: keys and values, as otwarp haptics config prints"
            )
        changed(two_hands((), ()), data)  # refused with the file's name, before there is a scene
    except InputError as error:
        raise InputError(f"--config {file}: {error}") from None
    return data
