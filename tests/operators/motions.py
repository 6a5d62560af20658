"""What hands, devices and simulations do to chains in the tests: all that they may, in every world something else."""

from __future__ import annotations

import math

import numpy as np

from otwarp.haptics.chain.chain import CLUTCH, DEAD_MAN
from tests.operators.twins import Twins

SMOOTH, JERKY, RESTING, MOTIONS = 0, 1, 2, 3


class Turmoil:
    """A rough session of twins: world by world other motions, and now and then something that goes wrong.

    Smooth hands are five sines per axis, jerky ones leap by millimetres, resting ones tremble. Spheres relax to their
    traps. States come every 8 periods, the twins' simulations take commands as they come.

    Args:
        twins: Driven.
        seed: Of everything.
        speed: Root mean square of smooth hands [m/s].
    """

    def __init__(self, twins: Twins, seed: int, *, speed: float = 0.05):
        self.twins = twins
        config = twins.plans[0].config
        self.quantum = config.chain.quantum
        # a servo that hears of gains measures absolute motion from a new place, which rounds otherwise
        self._gains = 0.0 if config.absolute else 0.005
        self.rng = rng = np.random.default_rng(seed)
        shape = twins.hand.shape
        self._frequency = rng.uniform(0.2, 6.0, (5, *shape))
        self._phase = rng.uniform(0.0, 2.0 * math.pi, (5, *shape))
        self._size = speed / (2.0 * math.pi * self._frequency)
        self._offset = np.zeros(shape)
        self._motion = np.arange(twins.worlds) % MOTIONS
        self._simulates = np.zeros(twins.worlds, dtype=int)  # periods for which a simulation stands still
        self._hears = np.zeros(shape[:2], dtype=int)  # and for which a device is silent
        self._home = rng.normal(0.0, 2.0, (twins.worlds, twins.trap.shape[1], 3))
        self._home[0] *= 0.1  # about the origin, where nothing is that was never heard of
        twins.trap[:] = self._home
        self.n = 0

    def run(self, periods: int) -> None:
        """So many periods."""
        for _ in range(periods):
            self._period()
            self.n += 1

    def _now(self, chance: float, shape: tuple[int, ...] | int) -> np.ndarray:
        """Whether something that happens so often per period happens."""
        return self.rng.random(shape) < chance

    def _period(self) -> None:
        twins, rng = self.twins, self.rng
        worlds, hands = twins.fresh.shape
        self._simulates = np.maximum(self._simulates - 1, 0)
        self._simulates[self._now(1e-3, worlds)] = rng.choice((25, 60, 130))
        if self.n % 8 == 0:
            self._simulate(self._simulates == 0)
        self._hears = np.maximum(self._hears - 1, 0)
        self._hears[self._now(1e-3, (worlds, hands))] = rng.choice((1, 3, 30, 120))
        twins.fresh[:] = self._hears == 0
        twins.buttons[self._now(5e-4, (worlds, hands))] = rng.choice((0, DEAD_MAN, DEAD_MAN | CLUTCH))
        twins.buttons[self._now(3e-3, (worlds, hands))] = DEAD_MAN
        twins.elapsed[:] = 1e-3 + 2e-5 * rng.normal(size=worlds)
        late = self._now(2e-3, worlds)
        twins.elapsed[late] = rng.choice((0.0, 0.0, 0.0, 0.004, 0.03, 0.2, -0.01, math.nan), late.sum())
        if self._now(0.003, ()):
            twins.arm(self._now(0.5, worlds), armed=bool(rng.random() < 0.8))
        if self._now(self._gains, ()):
            twins.gain[rng.integers(worlds), rng.integers(hands)] *= rng.choice((0.5, 2.0))
        self._move()
        twins.period()

    def _move(self) -> None:
        twins, rng = self.twins, self.rng
        t = 1e-3 * self.n
        leaps = self._now(0.01, self._offset.shape) & (self._motion == JERKY)[:, None, None]
        self._offset += leaps * rng.normal(0.0, 1e-3, self._offset.shape)
        wave = np.sum(self._size * np.sin(2.0 * math.pi * self._frequency * t + self._phase), axis=0)
        tremor = 1e-4 * np.sin(2.0 * math.pi * 9.0 * t + self._phase[0])
        place = np.where((self._motion == RESTING)[:, None, None], tremor, wave + self._offset)
        if self.quantum:
            place = self.quantum * np.round(place / self.quantum)
        heard = twins.fresh.astype(bool)
        twins.hand[heard] = place[heard]
        broken = self._now(4e-4, heard.shape)
        twins.hand[broken, rng.integers(3)] = rng.choice((math.nan, math.inf, 1e6))

    def _simulate(self, alive: np.ndarray) -> None:
        """A state of the worlds that are alive: traps where they were commanded, spheres on their way there."""
        twins, rng = self.twins, self.rng
        worlds = twins.worlds
        if self.n:
            commanded = twins.batch.commanded.numpy()
            wild = ~np.isfinite(commanded) | (np.abs(commanded) > 1e3)
            twins.trap[alive] = np.where(wild, self._home, commanded)[alive]
        before, slow = twins.sphere.copy(), self._now(0.05, worlds)
        to = twins.trap[:, np.arange(twins.sphere.shape[1]) % twins.trap.shape[1]]
        twins.sphere = np.where(np.isfinite(twins.sphere) & (np.abs(twins.sphere) < 1e3), twins.sphere, to)
        twins.sphere += 0.3 * (to - twins.sphere) + rng.normal(0.0, 0.02, twins.sphere.shape)
        kicked = self._now(0.01, worlds)
        twins.sphere[kicked] += rng.normal(0.0, 0.5, twins.sphere[kicked].shape)
        twins.sphere[slow] = before[slow]  # a session in slow motion, which has stepped no farther
        leaves = self._now(0.02, worlds)
        twins.body[leaves, rng.integers(twins.body.shape[1])] = rng.integers(100)
        twins.time[alive] += np.where(slow, 0.0, 0.008)[alive]
        twins.time[self._now(2e-3, worlds)] = 0.0
        stale = twins.time.copy()
        twins.time[self._now(1e-3, worlds)] = math.nan
        twins.sphere[self._now(3e-3, worlds), 0, 1] = math.inf
        twins.publish(alive)
        twins.time = stale
