"""The local model: the optical force on the spheres near a hand, at the place where its traps are now (eq. 2).

`LocalModel` here is the sum over traps, spheres and powers. Beside it:

law         what is summed: curves of eq. 1, and force tables
compiled    `CompiledModel`, the same sum in one call of machine code; `CompiledLaw`, where that lies, and its trial
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, SceneFrame, Vec3, as_tuples
from otwarp.haptics.core.config import HandConfig
from otwarp.haptics.force.law import Law

MEMORY = 15 / 16
"""Of a model that predicts, from one state to the next: at 120 states/s it forgets within 0.13 s.

Thermal motion of 20 nm then spoils the share by 3 % at 5 µm/s; a hand that runs into a wall feels at most k·v·T too
little until it is forgotten."""


class ForceModel(Protocol):
    """What a chain renders: a force on the hand's traps as a function of how far the hand has carried them."""

    def refresh(self, scene: SceneFrame, traps: Mapping[int, Vec3]) -> bool:
        """Take in a newly published state; `traps` are the places of the hand's traps before it carried them [µm].

        Returns whether all numbers are finite; if not, the model stays as it was.
        """
        ...

    def force(self, x: float, y: float, z: float) -> Vec3:
        """Σ F on the spheres [pN] with the hand's traps carried by x, y, z [µm]."""
        ...

    def state(self) -> dict[str, Any]:
        """What changes from step to step and no `refresh` brings back, for JSON, by its names in recordings."""
        ...

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a `state`, after a `refresh` with the scene of that moment."""
        ...


class LocalModel:
    """Eq. 2: the force of a hand's traps on all spheres, ΣF = Σ_traps Σ_spheres P·F(sphere − focus).

    Spheres of one optical kind share a law; a robot of equal spheres has one kind. A place in `SceneFrame.spheres` that
    goes to another body has that body's sphere at once: it did not move there.

    Args:
        laws: For each trap of the scene that a hand moves, its law for each kind.
        kinds: Kind of each sphere, in the order of `SceneFrame.spheres`; empty for kind 0 throughout.
        smoothing: α per servo period with which sphere positions follow what is published, 1 for at once.
        prediction: Whether spheres are taken to have followed the hand since a state was computed: by the share of the
            traps' way that each went lately, of the way from where the state has the traps to where they are. A sphere
            that follows its trap then does not seem to lag by what the trap moved since: at 120 states/s, 10 pN/µm and
            5 µm/s that is 0.2 pN on average, where the drag on a bead of 1 µm is 0.08 pN. How old a state is does not
            matter, for its traps say where the hand was. A hand at rest feels no prediction, so neither a kick nor
            thermal motion is carried on, and a sphere that is held back stays where it was seen. A state in which
            simulated time has not gone on, as in slow motion, teaches it nothing.

    Attributes:
        laws, smoothing, prediction: As given.
        traps: The hand's traps: place before it carried them [µm], power [mW], law and kind.
        targets: Per kind, where its spheres were published last [µm].
        spheres: Where the force takes them to be [µm]: `targets` itself, or on the way there.
        shares: Of the traps' way that each sphere went lately, 0 … 1; empty where nothing is predicted.
        carried: How far the state had the traps carried [µm].

    Raises:
        InputError: A trap without a law, a kind that it has none for, smoothing out of range.
    """

    def __init__(
        self,
        laws: Mapping[int, Sequence[Law]],
        kinds: Sequence[int] = (),
        *,
        smoothing: float = 1.0,
        prediction: bool = False,
    ) -> None:
        for trap, choices in laws.items():
            if not choices:
                raise InputError(f"trap {trap} has no force law; allowed: one for each kind of sphere")
            if kinds and not 0 <= min(kinds) <= max(kinds) < len(choices):
                raise InputError(f"sphere kinds are {min(kinds)} to {max(kinds)}; allowed: 0 to {len(choices) - 1}")
        if not 0.0 < smoothing <= 1.0:
            raise InputError(f"pose smoothing is {smoothing!r}; allowed: above 0 to 1")
        self.laws = {trap: tuple(choices) for trap, choices in laws.items()}
        self.smoothing = smoothing
        self._kinds = tuple(kinds)
        self.traps: list[tuple[float, float, float, float, Law, int]] = []
        self.spheres: list[list[Vec3]] = []
        self.targets: list[list[Vec3]] = []
        self._bodies: Sequence[Sequence[int]] = ()
        self._time = -math.inf
        self.prediction = prediction
        self.shares: list[list[float]] = []
        self._went: list[list[float]] = []
        self._way = 0.0
        self._focus: Vec3 | None = None
        self.carried = ZERO

    @property
    def kinds(self) -> tuple[int, ...]:
        """Kind of each sphere; empty for kind 0 throughout."""
        return self._kinds

    def refresh(self, scene: SceneFrame, traps: Mapping[int, Vec3]) -> bool:
        """See `ForceModel.refresh`.

        Raises:
            InputError: A trap that has no law, or spheres that have no kind.
        """
        if self._kinds and len(self._kinds) != len(scene.spheres):
            raise InputError(f"the scene has {len(scene.spheres)} spheres; allowed: {len(self._kinds)}, one per kind")
        groups = 1 + max(self._kinds, default=0)
        targets: list[list[Vec3]] = [[] for _ in range(groups)]
        bodies: list[list[int]] = [[] for _ in range(groups)]
        total = 0.0
        for n, sphere in enumerate(scene.spheres):
            x, y, z = sphere.position
            total += x + y + z
            kind = self._kinds[n] if self._kinds else 0
            targets[kind].append(sphere.position)
            bodies[kind].append(sphere.body)
        rows = []
        focus: Vec3 | None = None
        carried = ZERO
        for trap in scene.traps:
            if trap.index not in traps:
                continue
            if trap.index not in self.laws:
                raise InputError(f"trap {trap.index} has no force law; allowed: {sorted(self.laws)}")
            x, y, z = traps[trap.index]
            total += x + y + z + trap.power
            if focus is None:  # a hand carries all its traps alike
                focus = u, v, w = trap.position
                carried = (u - x, v - y, w - z)
                total += u + v + w
            choices = self.laws[trap.index]
            rows += [(x, y, z, trap.power, choices[kind], kind) for kind in range(groups)]
        if not math.isfinite(total):
            return False
        self.traps = rows
        same = [len(group) for group in targets] == [len(group) for group in self.spheres]
        if same and bodies != [list(group) for group in self._bodies]:
            self._exchange(targets, bodies)
        stood = same and scene.time == self._time and targets == self.targets
        if self.prediction:
            if not stood:
                self._learn(targets, focus, same)
            self.carried = carried
        if self.smoothing == 1.0 or not same:
            self.spheres = targets
        self.targets, self._bodies, self._time = targets, bodies, scene.time
        return True

    def state(self) -> dict[str, Any]:
        """See `ForceModel.state`."""
        model = [self.shares, self._went, self._way, self._focus, self.carried, self._bodies, self._time]
        spheres = None if self.spheres is self.targets else self.spheres  # None: where they were published
        return {"model": model, "targets": self.targets, "spheres": spheres}

    def restore(self, state: Mapping[str, Any]) -> None:
        """See `ForceModel.restore`."""
        shares, went, self._way, focus, carried, bodies, self._time = state["model"]
        self.shares, self._went = as_tuples(shares), as_tuples(went)
        self._focus, self.carried, self._bodies = as_tuples(focus), as_tuples(carried), as_tuples(bodies)
        spheres = state["spheres"]
        self.targets = [[as_tuples(vector) for vector in group] for group in state["targets"]]
        self.spheres = self.targets if spheres is None else [[as_tuples(v) for v in group] for group in spheres]

    def _exchange(self, targets: list[list[Vec3]], bodies: list[list[int]]) -> None:
        """Where a place goes to another body, its past is where that body is now, and nothing is known of its way."""
        standing = self.spheres is self.targets

        def _of(past: list[list[Vec3]]) -> list[list[Vec3]]:
            return [
                [new if a != b else old for old, new, a, b in zip(*rows, strict=True)]
                for rows in zip(past, targets, self._bodies, bodies, strict=True)
            ]

        self.targets, spheres = _of(self.targets), self.spheres
        self.spheres = self.targets if standing else _of(spheres)
        if self._went:  # only of a model that predicts
            self._went = [
                [sum_ if a == b else 0.0 for sum_, a, b in zip(*rows, strict=True)]
                for rows in zip(self._went, self._bodies, bodies, strict=True)
            ]

    def _learn(self, targets: list[list[Vec3]], focus: Vec3 | None, same: bool) -> None:
        """How much of its trap's way each sphere went lately: Σ(way of sphere · way of trap)/Σ(way of trap)².

        Both are sums over the states since the model was made, each state's part weighing `MEMORY` of the one after it.
        Thermal motion is in the ends of a way alone, so that it counts little once the trap has gone far.
        """
        before = self._focus
        self._focus = focus
        if not same or before is None or focus is None:
            self.shares, self._went, self._way = [], [[0.0] * len(group) for group in targets], 0.0
            return
        a, b, c = focus[0] - before[0], focus[1] - before[1], focus[2] - before[2]
        self._way = MEMORY * self._way + a * a + b * b + c * c
        self._went = [
            [
                MEMORY * sum_ + a * (u - x) + b * (v - y) + c * (w - z)
                for sum_, (x, y, z), (u, v, w) in zip(sums, then, now, strict=True)
            ]
            for sums, then, now in zip(self._went, self.targets, targets, strict=True)
        ]
        way = self._way
        self.shares = [[min(max(s / way, 0.0), 1.0) for s in sums] for sums in self._went] if way > 0.0 else []

    def force(self, x: float, y: float, z: float) -> Vec3:
        """See `ForceModel.force`."""
        if self.spheres is not self.targets:
            self._approach()
        fx = fy = fz = 0.0
        spheres = self._ahead(x, y, z) if self.prediction else self.spheres
        for u, v, w, power, law, kind in self.traps:
            gx, gy, gz = law.pull(u + x, v + y, w + z, spheres[kind])
            fx += power * gx
            fy += power * gy
            fz += power * gz
        return fx, fy, fz

    def _ahead(self, x: float, y: float, z: float) -> list[list[Vec3]]:
        """The spheres where they have come to by now, with the hand's traps carried by x, y, z [µm]."""
        if not self.shares:
            return self.spheres
        a, b, c = self.carried
        a, b, c = x - a, y - b, z - c
        return [
            [(u + s * a, v + s * b, w + s * c) for (u, v, w), s in zip(group, shares, strict=True)]
            for group, shares in zip(self.spheres, self.shares, strict=True)
        ]

    def _approach(self) -> None:
        """Move the spheres one servo period on towards where they were last published."""
        a = self.smoothing
        self.spheres = [
            [
                (x + a * (u - x), y + a * (v - y), z + a * (w - z))
                for (x, y, z), (u, v, w) in zip(now, then, strict=True)
            ]
            for now, then in zip(self.spheres, self.targets, strict=True)
        ]


class Code(Protocol):
    """Compiled laws, see `otwarp.haptics.force.compiled.CompiledLaw`."""

    def model(
        self, laws: Mapping[int, Sequence[Law]], kinds: Sequence[int], *, smoothing: float, prediction: bool
    ) -> LocalModel:
        """A local model that computes with them, see `LocalModel`."""
        ...


def local_model(
    config: HandConfig, laws: Mapping[int, Sequence[Law]], kinds: Sequence[int] = (), code: Code | None = None
) -> LocalModel:
    """The local model of a hand: laws of its traps alone, sphere positions smoothed as its chain asks.

    Args:
        config: Of the hand.
        laws, kinds: As `LocalModel`.
        code: The laws compiled; None for plain Python, which has the same bits.

    Raises:
        InputError: A trap of the hand without a law, or as `LocalModel`; code that cannot be loaded.
    """
    for trap in config.traps:
        if trap not in laws:
            raise InputError(f"hand.traps has {trap}, which has no force law; allowed: {sorted(laws)}")
    slow = config.chain.pose_filter
    smoothing = slow.at(config.chain.rate).alpha if slow else 1.0
    make = LocalModel if code is None else code.model
    chosen = {trap: laws[trap] for trap in config.traps}
    return make(chosen, kinds, smoothing=smoothing, prediction=config.chain.pose_prediction)
