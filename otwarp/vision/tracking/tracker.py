"""`Tracker`: a body followed through late, missing and wrong measurements, and predicted between them."""

from __future__ import annotations

import dataclasses
import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from scipy.special import gammainccinv

from otwarp.errors import InputError
from otwarp.vision.tracking.belief import Belief, Correction, advance, apart, at_prim, begin, correct, near
from otwarp.vision.tracking.commands import Commands
from otwarp.vision.tracking.measurement import Measurement
from otwarp.vision.tracking.mobile import MobileBody
from otwarp.vision.tracking.pushing import Pushed, PushLaw
from otwarp.vision.tracking.shape import Shape

SAME = 0.25
"""Squared distance of two hypotheses over their covariance below which they are one."""

LEAST = 1e-6
"""Probability below which a hypothesis is given up."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pose:
    """Where a body is at a time.

    Attributes:
        time: [s].
        position: (3) origin of its prim [µm].
        orientation: (4) quaternion of its prim.
        covariance: (6, 6) of that position and of the turn in the axes of the world [µm², rad²].
        probability: Of this hypothesis among all.
        belief: About the centre of diffusion.
    """

    time: float
    position: np.ndarray
    orientation: np.ndarray
    covariance: np.ndarray
    probability: float
    belief: Belief


@dataclass(frozen=True, eq=False)
class Update:
    """What came of a measurement.

    Attributes:
        time: Of the measurement [s].
        accepted: Whether some hypothesis took it.
        nis: Squared innovation over its covariance, for the likeliest hypothesis; nan for the first measurement.
        degrees: Of freedom of its χ² distribution.
        replayed: Measurements after it that were put in again.
    """

    time: float
    accepted: bool
    nis: float
    degrees: int
    replayed: int = 0


@dataclass(frozen=True, eq=False)
class _Node:
    """A measurement, and what was believed once it was in."""

    time: float
    seen: Measurement
    beliefs: tuple[Belief, ...]
    update: Update
    refused: int = 0


class Tracker:
    """An error-state Kalman filter of a body whose noise and drift are those of its simulation.

    Measurements go in at their own time, in any order: later ones are put in again behind them. What results is what
    the same measurements would have given in order, to the last bit.

    Args:
        body: How it moves.
        shape: What is seen of it.
        commands: What its traps are told.
        lag: For how long measurements may be late [s].
        gate: Probability with which a right measurement is refused as an outlier.
        patience: So many refused in a row begin the track anew.
        push: Of forces that the simulation does not know, which are followed with the pose; None: there are none.
        spread: Standard deviations of where the scene starts the body [µm], [rad], for what the first measurement does
            not say.

    Raises:
        InputError: A number out of its range.

    Example:
        >>> tracker = Tracker(body, Shape.of(scene, scene.bodies[0].name, body.reference), Commands.of_scene(scene))
        >>> tracker.add(Measurement(time=0.02, position=[0, 0, 5], covariance=1e-4 * np.eye(3))).accepted
        True
        >>> tracker.predict(0.021).position
    """

    def __init__(
        self,
        body: MobileBody,
        shape: Shape,
        commands: Commands,
        *,
        lag: float = 0.5,
        gate: float = 1e-6,
        patience: int = 10,
        push: PushLaw | None = None,
        spread: tuple[float, float] = (3.0, 0.5),
    ):
        limits = {"lag": (lag, 0.0, 1e6), "gate": (gate, 0.0, 0.5), "patience": (patience, 1, 1e9)}
        limits |= {f"spread[{n}]": (s, 1e-9, 1e6) for n, s in enumerate(spread)}
        for name, (value, low, high) in limits.items():
            if not low <= value <= high:
                raise InputError(f"{name} of a tracker is {value:g}; allowed: {low:g} to {high:g}")
        self.body, self.shape, self.commands = body, shape, commands
        self.lag, self.patience, self.push, self.spread = lag, patience, push, spread
        # a probability of 0 lets everything pass
        self._gates = [math.inf] * 7 if gate == 0.0 else [
            2.0 * float(gammainccinv(0.5 * n, gate)) if n else 0.0 for n in range(7)
        ]  # fmt: skip
        self._nodes: list[_Node] = []
        self._trimmed = False

    @property
    def time(self) -> float | None:
        """Of the latest measurement [s]; None before the first."""
        return self._nodes[-1].time if self._nodes else None

    @property
    def oldest(self) -> float | None:
        """Of the oldest measurement that is kept [s]; None before the first."""
        return self._nodes[0].time if self._nodes else None

    def add(self, seen: Measurement) -> Update:
        """Put a measurement in at its time.

        Raises:
            InputError: It is older than what is kept.
        """
        place = bisect_right(self._nodes, seen.time, key=lambda node: node.time)
        if place == 0 and self._trimmed:
            oldest = self._nodes[0].time
            raise InputError(
                f"time of a measurement is {seen.time:.6g} s; allowed: from {oldest:.6g} s on, a lag of {self.lag:g} s"
            )
        whole = self._nodes
        self._nodes, later = whole[:place], whole[place:]
        try:
            self._put(seen)
            update = dataclasses.replace(self._nodes[-1].update, replayed=len(later))
            self._replay(later)
        except BaseException:
            self._nodes = whole  # a measurement that cannot be put in takes none of the others away
            raise
        self._trim()
        return update

    def command(self, time: float, *, position: np.ndarray | None = None, power: np.ndarray | None = None) -> None:
        """Traps are told something from a time on, which may be past.

        Args:
            time: [s].
            position: (T, 3) [µm].
            power: (T) [mW].

        Raises:
            InputError: A wrong shape or value, or a time that is no longer kept.
        """
        if self._trimmed and time < self._nodes[0].time:
            raise InputError(f"time of a command is {time:.6g} s; allowed: from {self._nodes[0].time:.6g} s on")
        self.commands.set(time, position=position, power=power)
        place = bisect_right(self._nodes, time, key=lambda node: node.time)
        later = self._nodes[place:]
        del self._nodes[place:]
        self._replay(later)

    def predict(self, time: float) -> Pose:
        """The pose at a time, from what was measured before it.

        Raises:
            InputError: Nothing was measured before it, or it is no longer kept.
        """
        place = bisect_right(self._nodes, time, key=lambda node: node.time)
        if place == 0:
            first = "nothing was measured yet" if not self._nodes else f"from {self._nodes[0].time:.6g} s on"
            raise InputError(f"time of a prediction is {time:.6g} s; allowed: {first}")
        node = self._nodes[place - 1]
        best = max(node.beliefs, key=lambda b: b.weight)
        if time > node.time and (fresh := near(best, self.body, self.commands.at(node.time))) is not best.expansion:
            # the next prediction, and the next measurement, find it made
            kept = dataclasses.replace(best, expansion=fresh)
            beliefs = tuple(kept if b is best else b for b in node.beliefs)
            self._nodes[place - 1] = node = dataclasses.replace(node, beliefs=beliefs)
            best = kept
        total = sum(math.exp(b.weight - best.weight) for b in node.beliefs)
        led = advance(best, self.body, self.commands, node.time, time)
        origin, covariance = at_prim(led, self.shape)
        return Pose(
            time=time, position=origin, orientation=led.orientation, covariance=covariance, probability=1.0 / total,
            belief=led,
        )  # fmt: skip

    @property
    def hypotheses(self) -> tuple[Belief, ...]:
        """At the latest measurement."""
        return self._nodes[-1].beliefs if self._nodes else ()

    def _replay(self, later: list[_Node]) -> None:
        for node in later:
            self._put(node.seen)

    def _put(self, seen: Measurement) -> None:
        """Append what a measurement makes of the latest node."""
        if not self._nodes:
            self._nodes.append(self._begun(seen))
            return
        last = self._nodes[-1]
        led = [advance(b, self.body, self.commands, last.time, seen.time) for b in last.beliefs]
        tried = [self._corrected(belief, seen) for belief in led]
        nis, degrees = min((c.nis, c.degrees) for _, c in tried)
        if not any(taken for taken, _ in tried):
            if last.refused + 1 >= self.patience:
                node = self._begun(seen)
                self._nodes.append(dataclasses.replace(node, update=Update(seen.time, False, nis, degrees)))
            else:
                update = Update(seen.time, False, nis, degrees)
                self._nodes.append(_Node(seen.time, seen, tuple(led), update, last.refused + 1))
            return
        best = max((c for taken, c in tried if taken), key=lambda c: c.belief.weight)
        beliefs = _kept([correction.belief for _, correction in tried], self.shape)
        self._nodes.append(_Node(seen.time, seen, beliefs, Update(seen.time, True, best.nis, best.degrees)))

    def _corrected(self, belief: Belief, seen: Measurement) -> tuple[bool, Correction]:
        """Whether a hypothesis takes a measurement, and what becomes of it: of the two signs that the tilt may have
        been seen with, the likelier corrects it, and both say how likely it is."""
        branches = [(seen, math.log1p(-seen.mirror))]
        if seen.mirror > 0.0:
            branches.append((seen.mirrored(), math.log(seen.mirror)))
        tried = [(share, correct(belief, branch, self.shape)) for branch, share in branches]
        evidence = float(np.logaddexp.reduce([share + c.likelihood for share, c in tried]))
        share, found = max(tried, key=lambda t: t[0] + t[1].likelihood)
        gate = self._gates[found.degrees]
        if found.nis <= gate:
            return True, dataclasses.replace(
                found, belief=dataclasses.replace(found.belief, weight=belief.weight + evidence)
            )
        # an outlier for it: it stays, and is as likely as if the measurement had come at the gate
        weight = belief.weight + share + found.likelihood + 0.5 * (found.nis - gate)
        return False, dataclasses.replace(found, belief=dataclasses.replace(belief, weight=weight))

    def _begun(self, seen: Measurement) -> _Node:
        place, turn = self.body.start
        first = self._pushed(begin(seen, self.shape, place, turn, self.spread))
        beliefs = [dataclasses.replace(first, weight=math.log1p(-seen.mirror))]
        if seen.mirror > 0.0:
            other = self._pushed(begin(seen.mirrored(), self.shape, place, turn, self.spread))
            beliefs.append(dataclasses.replace(other, weight=math.log(seen.mirror)))
        return _Node(seen.time, seen, _kept(beliefs, self.shape), Update(seen.time, True, math.nan, len(seen.known)))

    def _pushed(self, belief: Belief) -> Belief:
        """With nothing known of the push, if one is followed."""
        if self.push is None:
            return belief
        mobility = self.body.mobility(belief.orientation)
        return dataclasses.replace(belief, pushed=Pushed.unknown(self.push, mobility, belief.covariance))

    def _trim(self) -> None:
        """Forget what is older than the lag, but for the last before it."""
        oldest = self._nodes[-1].time - self.lag
        first = max(0, bisect_right(self._nodes, oldest, key=lambda node: node.time) - 1)
        if first:
            del self._nodes[:first]
            self._trimmed = True


def _kept(beliefs: list[Belief], shape: Shape) -> tuple[Belief, ...]:
    """Hypotheses that are likely enough and differ, their weights from 0 down."""
    ordered = sorted(beliefs, key=lambda b: -b.weight)
    kept: list[Belief] = []
    for belief in ordered:
        same = next((n for n, other in enumerate(kept) if apart(other, belief, shape) < SAME), None)
        if same is not None:
            both = float(np.logaddexp(kept[same].weight, belief.weight))
            kept[same] = dataclasses.replace(kept[same], weight=both)
        elif belief.weight >= ordered[0].weight + math.log(LEAST):
            kept.append(belief)
    top = kept[0].weight
    return tuple(dataclasses.replace(b, weight=b.weight - top) for b in kept)
