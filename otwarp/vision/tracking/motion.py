"""Overdamped motion near a pose: dδ = (v + A δ) dt + √(2 D) dW, a linear equation, and its exact step in time.

δ is the displacement of a body's centre of diffusion and its turn in the axes of the world, (6) [µm, rad].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from otwarp.vision.tracking.pushing import PushLaw, with_pushes
from otwarp.vision.tracking.rotations import difference, exponential, product

TERMS = 9
"""Of the series of the first step, which is at most 1/4 of a relaxation: 0.25⁹/9! is below rounding."""

REMEMBERED = 64
"""Steps of different lengths that an expansion keeps."""


@dataclass(frozen=True, eq=False)
class Transition:
    """What a time does to a displacement, exactly: δ → F δ + S v + R v̇ + N(0, Q), for a drift v + v̇ t.

    Attributes:
        decay: (6, 6) F = exp(A t).
        drift: (6, 6) S = ∫ exp(A s) ds [s].
        ramp: (6, 6) R = ∫ exp(A (t − s)) s ds [s²].
        noise: (6, 6) Q = 2 ∫ exp(A s) D exp(Aᵀ s) ds, in µm² and rad².
    """

    decay: np.ndarray
    drift: np.ndarray
    ramp: np.ndarray
    noise: np.ndarray


def transition(rate: np.ndarray, diffusion: np.ndarray, time: float) -> Transition:
    """The exact step of an Ornstein–Uhlenbeck process.

    A Taylor series over a short time is doubled until the time is reached: that holds for fast relaxation, for none and
    for both in one matrix, where inverting A or integrating backwards does not.

    Args:
        rate: (n, n) A [1/s].
        diffusion: (n, n) D, symmetric [µm²/s, rad²/s].
        time: 0 or more [s].
    """
    one = np.eye(len(rate))
    size = float(np.abs(rate).sum(axis=1).max()) * time
    halvings = max(0, math.ceil(math.log2(size / 0.25))) if size > 0.0 else 0
    t = time / 2**halvings
    a = rate * t
    power, drift, ramp = one, one.copy(), 0.5 * one
    terms = 2.0 * diffusion * t
    noise = terms.copy()
    for n in range(1, TERMS):
        power = power @ a
        power /= n
        drift += power / (n + 1)
        ramp += power / ((n + 1) * (n + 2))
        # d/dt of the integrand, which is symmetric: X → A X + X Aᵀ
        half = a @ terms
        terms = (half + half.T) / (n + 1)
        noise += terms
    decay = one + a @ drift
    drift, ramp = drift * t, ramp * t * t
    for _ in range(halvings):
        ramp = decay @ ramp + ramp + t * drift
        drift = drift + decay @ drift
        noise = noise + decay @ noise @ decay.T
        decay = decay @ decay
        t *= 2.0
    return Transition(decay, drift, ramp, 0.5 * (noise + noise.T))


@dataclass(frozen=True, eq=False)
class Expansion:
    """Motion near a pose, to first order in the pose and in what the traps are told.

    Attributes:
        position: (3) of the centre of diffusion [µm].
        orientation: (4) quaternion.
        command: (u) positions [µm] and powers [mW] of the traps.
        velocity: (6) there [µm/s, rad/s].
        rate: (6, 6) A, how velocity changes with the pose [1/s].
        response: (6, u) how it changes with the command.
        diffusion: (6, 6) D = kT M / η in the axes of the world.
        mobility: (6, 6) M / η in the axes of the world.
    """

    position: np.ndarray
    orientation: np.ndarray
    command: np.ndarray
    velocity: np.ndarray
    rate: np.ndarray
    response: np.ndarray
    diffusion: np.ndarray
    mobility: np.ndarray
    steps: dict[tuple[float, PushLaw | None], Transition] = field(default_factory=dict)

    def offset(self, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """(6) displacement and turn from where the motion is expanded."""
        return np.concatenate([position - self.position, difference(orientation, self.orientation)])

    def pose(self, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and orientation at an offset (6)."""
        return self.position + offset[:3], product(exponential(offset[3:]), self.orientation)

    @cached_property
    def growth(self) -> float:
        """Fastest rate at which a displacement grows [1/s]; 0 where all fade, as on a trap's rising side."""
        return max(0.0, float(np.linalg.eigvals(self.rate).real.max()))

    def step(self, time: float, law: PushLaw | None = None) -> Transition:
        """The exact step of so many seconds, of the pose, or of pose and push together; those asked for are kept."""
        if (time, law) not in self.steps:
            if len(self.steps) >= REMEMBERED:
                self.steps.pop(next(iter(self.steps)), None)
            motion = self.rate, self.diffusion
            if law is not None:
                motion = with_pushes(*motion, self.mobility, law)
            self.steps[time, law] = transition(*motion, time)
        return self.steps[time, law]

    def drifted(
        self, offset: np.ndarray, time: float, first: np.ndarray, last: np.ndarray, law: PushLaw | None = None
    ) -> np.ndarray:
        """(6) mean offset after a time in which the command goes from `first` to `last` (u) at constant rate.

        With a push, `offset` and what is returned have its velocity behind them, (12).
        """
        step = self.step(time, law)
        n = len(offset)
        start, gain = np.zeros(n), np.zeros(n)
        start[:6] = self.velocity + self.response @ (first - self.command)
        if time > 0.0:
            gain[:6] = self.response @ (last - first) / time
        return step.decay @ offset + step.drift @ start + step.ramp @ gain
