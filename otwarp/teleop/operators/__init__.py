"""What operators do and feel: which hand moves which traps, how, with what device, and what it feels of the scene.

The first is the scene's word, the user's, and a configuration file's (`plan_hands`). What is felt are the force laws of
the hand's traps and the trapped spheres near them (`LocalScene`). Beside these:

servo    runs devices and chains: a process of its own, or one in this process on a virtual clock
hands    the session's side of the servo; what hands, page and programs together command of the traps
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.haptics.core import SceneFrame, SphereFrame, TrapFrame
from otwarp.haptics.core.config import HandConfig, HapticsConfig, two_hands
from otwarp.haptics.core.fields import from_dict, to_dict
from otwarp.haptics.force.law import IsotropicLaw, Law, SplitLaw, TableLaw
from otwarp.laws.trap_law import MODELS
from otwarp.scene import Scene, description
from otwarp.scene.transforms import rotate
from otwarp.simulation.frame import Frame
from otwarp.simulation.model import Model
from otwarp.simulation.packing.optics import polarization_azimuth
from otwarp.teleop import HANDS, vec3

SLOTS = 16
"""Spheres of one optical kind that a servo period evaluates at most; the nearest to the hands' traps. The force on one
in reach costs up to 5 µs for each trap where the law runs in Python, so 16 leave a 1 kHz period room."""


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
        mode, pairing: Of the presets, as for `haptics.core.config.two_hands`. The older pairing swaps the hands' traps.
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


def authored_law(trap: description.Trap, radius: float) -> Law:
    """A trap's authored law as a sphere of `radius` [µm] feels it.

    Raises:
        InputError: A model that no operator can feel.
    """
    if trap.model not in MODELS:
        allowed = ", ".join((*MODELS, *description.OPTICAL_MODELS))
        raise InputError(f"{trap.prim}: ot:trap:model = {trap.model}: on a trap of a hand must be one of {allowed}")
    assert trap.radial is not None, "optical traps have tables"
    axis = vec3(rotate(np.array(trap.orientation), np.array([0.0, 0.0, 1.0])))
    laws = [law.per_mw().for_radius(radius) for law in (trap.radial, trap.axial) if law is not None]
    # a spring ends where its linear branch does
    curves = [replace(law, threshold=min(law.threshold, law.cutoff)) for law in laws]
    if len(curves) == 1:
        return IsotropicLaw(curves[0], axis, trap.equilibrium)
    return SplitLaw(curves[0], curves[1], axis, trap.equilibrium)


def optical_law(model: Model, trap: int, kind: int) -> Law:
    """A trap's tabulated law for one kind of sphere: from the table that the simulation has."""
    table = model.optics.tables[model.optics.table[trap, kind]]
    turn = polarization_azimuth(table.beam)
    frame = np.array([[math.cos(turn), math.sin(turn), 0.0], [0.0, 0.0, 1.0]])
    side, axis = rotate(np.array(model.scene.traps[trap].orientation), frame)
    return TableLaw.of(table, side=vec3(side), axis=vec3(axis))


@dataclass(frozen=True, eq=False)
class LocalScene:
    """The trapped spheres of a scene, and who pulls on them how.

    Attributes:
        laws: For each trap, its law for each kind of sphere.
        kinds: Kind of each slot of `SceneFrame.spheres`.
    """

    laws: dict[int, tuple[Law, ...]]
    kinds: tuple[int, ...]
    _body: np.ndarray
    _offset: np.ndarray
    _kind: np.ndarray
    _hands: np.ndarray
    _chosen: np.ndarray = field(repr=False)

    @classmethod
    def of(cls, model: Model, hands: Sequence[int], *, slots: int = SLOTS) -> LocalScene:
        """From a built model.

        Args:
            hands: Indices of the traps that hands move; the spheres nearest to them fill the slots.
            slots: Most spheres of one kind.
        """
        scene, optics = model.scene, model.optics
        spheres = [(b, s) for b, body in enumerate(scene.bodies) for s in body.spheres if s.trapped]
        kinds = np.array([optics.kind(s.radius, s.refractive_index) for _, s in spheres], dtype=int)
        laws = {
            t: tuple(
                optical_law(model, t, k) if trap.optical else authored_law(trap, radius)
                for k, (radius, _) in enumerate(optics.kinds)
            )
            for t, trap in enumerate(scene.traps)
            if t in set(hands)
        }
        chosen = np.concatenate(
            [np.zeros(0, dtype=int), *(np.flatnonzero(kinds == k)[:slots] for k in range(len(optics.kinds)))]
        )
        return cls(
            laws if spheres else {},
            tuple(int(k) for k in kinds[chosen]),
            np.array([b for b, _ in spheres], dtype=int),
            np.array([s.offset for _, s in spheres]).reshape(-1, 3),
            kinds,
            np.array(sorted(set(hands)), dtype=int),
            chosen,
        )

    @property
    def bodies(self) -> tuple[int, ...]:
        """Index of the body whose sphere is in each slot now."""
        return tuple(self._body[self._chosen].tolist())

    def now(self, beat: int, frame: Frame) -> SceneFrame:
        """A state as the servo takes it; the frame's numbers may be anything, the servo refuses what is not finite."""
        place = frame.spheres(self._body, self._offset)[0]
        self._choose(place, frame.trap_position[0][self._hands])
        body, rows = self._body, place[self._chosen].tolist()
        spheres = tuple(SphereFrame(vec3(row), int(body[i])) for row, i in zip(rows, self._chosen, strict=True))
        traps = tuple(
            TrapFrame(t, vec3(row), power)
            for t, (row, power) in enumerate(
                zip(frame.trap_position[0].tolist(), frame.trap_power[0].tolist(), strict=True)
            )
        )
        load = float(frame.contact_load.max(initial=0.0))
        return SceneFrame(beat, frame.time, spheres, traps, load)

    def _choose(self, place: np.ndarray, foci: np.ndarray) -> None:
        """Fill the slots with the spheres nearest to the hands; one that stays keeps its slot, so that filters may."""
        if len(self._chosen) == len(place) or not len(foci):
            return
        gap = np.min(np.linalg.norm(place[:, None] - foci, axis=-1), axis=1)
        for kind in set(self.kinds):
            slots = np.flatnonzero(np.array(self.kinds) == kind)
            of_kind = np.flatnonzero(self._kind == kind)
            nearest = of_kind[np.argsort(gap[of_kind], kind="stable")[: len(slots)]]
            stay = np.isin(self._chosen[slots], nearest)
            self._chosen[slots[~stay]] = np.setdiff1d(nearest, self._chosen[slots[stay]], assume_unique=True)


def reach_of(law: Law) -> float:
    """Distance from the focus beyond which a law pulls no more [µm], inf if it has no end."""
    if isinstance(law, TableLaw):
        return law.grids[-1].end
    if isinstance(law, SplitLaw):
        return max(law.radial.cutoff, law.axial.cutoff) + abs(law.equilibrium)
    return law.curve.cutoff + abs(law.equilibrium) if isinstance(law, IsotropicLaw) else math.inf
