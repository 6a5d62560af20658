"""A simple SIMULATED operator, who acts late, now and then and not quite exactly; and a policy that shares control."""

from __future__ import annotations

from collections import deque

import numpy as np

from otwarp.envs.experts.policies import Seen
from otwarp.envs.task import Policy


class Operator:
    """Does what a script would, but late, at intervals, and with noise that grows with the speed.

    Three traits of the operators of `otwarp.operators`, whose arm, device and haptic chain it has not.

    Args:
        intent: What he would do about what he sees.
        rate: Control periods a second [Hz].
        delay: (N) time from a picture to what he makes of it [s].
        interval: (N) time between two decisions [s].
        noise: (N) standard deviation of his speed along each axis over the speed [1].
        seed: Of the noise.
    """

    def __init__(
        self, intent: Policy, rate: float, delay: np.ndarray, interval: np.ndarray, noise: np.ndarray, seed: int = 0
    ):
        self.intent, self.noise, self.generator = intent, noise[:, None], np.random.default_rng(seed)
        self.late = np.rint(delay * rate).astype(int)
        self.every = np.maximum(np.rint(interval * rate).astype(int), 1)
        self._memory: deque[np.ndarray] = deque(maxlen=int(self.late.max()) + 1)
        self._age = np.zeros(len(delay), dtype=int)
        self._action: np.ndarray = np.zeros(0)

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, A) actions; he rests until he has seen something of an episode."""
        wanted = self.intent(seen, fresh)
        if self._action.shape != wanted.shape:
            self._action = np.zeros_like(wanted)
        self._age = np.where(fresh, 0, self._age + 1)
        self._action[fresh] = 0.0
        self._memory.append(wanted)
        known = self._age >= self.late
        rows = np.flatnonzero(known & ((self._age - self.late) % self.every == 0))
        for row in rows:
            late = self._memory[-1 - self.late[row]][row]
            self._action[row] = late * (1.0 + self.noise[row] * self.generator.normal(size=late.shape))
        return self._action.copy()


class Shared:
    """A policy and an operator, mixed.

    Args:
        policy, operator: Who acts.
        authority: Share of the policy, 0 to 1.
    """

    def __init__(self, policy: Policy, operator: Policy, authority: float):
        self.policy, self.operator, self.authority = policy, operator, authority

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, A) actions."""
        return self.authority * self.policy(seen, fresh) + (1.0 - self.authority) * self.operator(seen, fresh)
