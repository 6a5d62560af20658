"""The public release's haptic chain as it is, for comparison: filtered per message, from a distance alone, unclamped.

On every message of the trap and on every message of the robot, with d their distance and n the direction from trap to
robot: F ← F + α(f(d)·n − D·Δd/Δt·n − F), force on the hand = G_hand·F. Nothing happens before both were heard of, nor
at d = 0. Nothing limits the force, and it is held for ever when messages stop. The device node subtracts its damping
times the hand's velocity, when a force arrives.

With D > 0 the release's damping term pulls less when the distance grows, which feeds motion away from the robot rather
than damping it; it ships D = 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.chain.motion import VectorFilter
from otwarp.haptics.core import ZERO, SceneFrame, Vec3, as_tuples
from otwarp.haptics.core.config import RELEASE_ALPHA, RELEASE_GAIN, RELEASE_RATE, ChainConfig, HandConfig, LowPass
from otwarp.haptics.force import ForceModel, LocalModel
from otwarp.haptics.force.law import IsotropicLaw, Law, SplitLaw
from otwarp.laws import TrapLaw

RELEASE_LAW = TrapLaw(stiffness=12000.0, threshold=0.08, inverse_square=16.18, offset=-1568.0, cutoff=0.10, power=1.0)
"""Eq. 1 with the release's constants, in its raw force units and scene units."""

TOUCHING = 1e-9
"""Distance at which the release gives no force a direction, and sends none [scene units]."""


def curve_of(law: TrapLaw, power: float = 1.0) -> Callable[[float], float]:
    """Pull [pN, or the release's raw units] of eq. 1 at a distance [µm, or its scene units], for a power [mW]."""

    def _pull(distance: float) -> float:
        if distance < law.threshold:
            return power * law.stiffness * distance
        if distance < law.cutoff:
            return power * (law.inverse_square / distance**2 + law.offset)
        return 0.0

    return _pull


class PaperForce:
    """The release's force node: messages in, a force out with each of them.

    Args:
        pull: f(d) in raw units.
        gain: G_hand [N per raw unit].
        alpha: α_f per message.
        distance_damping: D.

    Attributes:
        gain: As given; a change counts from the next message on.
        force: Last force sent, in the scene's axes [N].
        trap: Where the trap is, None before it was heard of.
        filter: Of the force.
    """

    __slots__ = ("_damping", "_last", "_robot", "filter", "force", "gain", "pull", "trap")

    def __init__(
        self,
        pull: Callable[[float], float] | None = None,
        *,
        gain: float = RELEASE_GAIN,
        alpha: float = RELEASE_ALPHA,
        distance_damping: float = 0.0,
    ) -> None:
        self.pull = pull or curve_of(RELEASE_LAW)
        self.gain, self._damping = gain, distance_damping
        self.filter = VectorFilter(alpha)
        self.trap: Vec3 | None = None
        self._robot: Vec3 | None = None
        self._last: tuple[float, float] | None = None
        self.force: Vec3 = ZERO

    def trap_message(self, position: Vec3, time: float) -> Vec3:
        """The trap is here, at this time of the node's clock [s]; returns `force`."""
        self.trap = position
        return self._publish(time)

    def robot_message(self, position: Vec3, time: float) -> Vec3:
        """The robot is here; as `trap_message`."""
        self._robot = position
        return self._publish(time)

    def _publish(self, time: float) -> Vec3:
        if self.trap is None or self._robot is None:
            return self.force
        x, y, z = (a - b for a, b in zip(self._robot, self.trap, strict=True))
        distance = math.sqrt(x * x + y * y + z * z)
        if distance <= TOUCHING:
            return self.force
        raw = self.pull(distance)
        if self._last is not None and time > self._last[1]:
            raw -= self._damping * (distance - self._last[0]) / (time - self._last[1])
        self._last = (distance, time)
        k = raw / distance
        fx, fy, fz = self.filter.step(k * x, k * y, k * z)
        self.force = (self.gain * fx, self.gain * fy, self.gain * fz)
        return self.force

    def state(self) -> list[Any]:
        """What changes from message to message, for JSON; without the filter, which has a state of its own."""
        return [self._last, self._robot, self.trap, self.force, self.gain]

    def restore(self, state: Sequence[Any]) -> None:
        """Go on from a `state`."""
        self._last, self._robot, self.trap, self.force, self.gain = as_tuples(state)


class PaperRenderer:
    """The release's force node fed from published states, one trap and one sphere per hand.

    Its trap is the hand's first, its robot the sphere that was nearest to it when the hand took hold. The release knows
    the distance alone: of a law with two curves it takes the one across the beam, for whatever direction.

    Args:
        config: Of the hand.
        model: Holds the trap's laws, which must be authored curves.

    Attributes:
        node: The release's.

    Raises:
        InputError: A hand without a trap, or a trap whose force is a table.
    """

    def __init__(self, config: HandConfig, model: ForceModel) -> None:
        choices = model.laws.get(config.traps[0], ()) if isinstance(model, LocalModel) and config.traps else ()
        curves = [curve_law(law) for law in choices]
        if not curves or None in curves:
            allowed = "a first trap with a force curve"
            raise InputError(f"chain.mode is 'paper' with traps {config.traps}; allowed: {allowed}")
        self._curves = [curve for curve in curves if curve is not None]
        self._kinds = model.kinds if isinstance(model, LocalModel) else ()
        self._hand, self._gain = config, config.force_gain
        self.node = self._restarted()
        self._robot = -1

    def _restarted(self) -> PaperForce:
        chain: ChainConfig = self._hand.chain
        # per message, whatever the rate of messages: that is the point of this mode
        alpha = (chain.force_filter or LowPass(alpha=RELEASE_ALPHA, rate=2.0 * RELEASE_RATE)).alpha
        return PaperForce(gain=self._gain, alpha=alpha, distance_damping=chain.distance_damping)

    def set_gain(self, gain: float) -> None:
        """Another G_hand [N per raw unit], from the next message on."""
        self._gain = self.node.gain = gain

    def reset(self) -> None:
        """A node as at its start, and no robot: the next state that is published chooses one."""
        self.node, self._robot = self._restarted(), -1

    def state(self) -> list[Any]:
        """What changes from step to step, for JSON; without the node, which has a state of its own."""
        return [self._gain, self._robot]

    def restore(self, state: Sequence[Any]) -> None:
        """Go on from a `state`."""
        self._gain, self._robot = state

    def published(self, scene: SceneFrame, time: float) -> Vec3:
        """Both messages of a published state; force in the scene's axes [N]."""
        trap = next((t for t in scene.traps if t.index == self._hand.traps[0]), None)
        if trap is None or not scene.spheres:
            return self.node.force
        if not 0 <= self._robot < len(scene.spheres):
            gaps = [math.dist(sphere.position, trap.position) for sphere in scene.spheres]
            self._robot = gaps.index(min(gaps))
        kind = self._kinds[self._robot] if self._kinds else 0
        self.node.pull = curve_of(self._curves[kind], trap.power)
        robot = scene.spheres[self._robot].position
        if self._hand.chain.messages_per_state == 1:
            self.node.trap = trap.position
        else:
            self.node.trap_message(trap.position, time)
        return self.node.robot_message(robot, time)


def curve_law(law: Law) -> TrapLaw | None:
    """The law's force as a function of distance, None for one that is none."""
    if isinstance(law, SplitLaw):
        return law.radial
    return law.curve if isinstance(law, IsotropicLaw) else None
