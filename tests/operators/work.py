"""Simulated operators for tests: at the shipped task, or with their hands alone."""

import numpy as np
import warp as wp

from otwarp.operators.loop import Loop
from otwarp.operators.people import persons
from otwarp.operators.population import load_population
from otwarp.operators.study import OperatorStudy
from otwarp.operators.task import task_of
from otwarp.scene import Scene

PERIOD = 1e-3


def scene():
    return Scene.load("scenes/cell_delivery.usda")


def study(**changes):
    """Three operators whose trials are given up after 0.2 s."""
    asked = {"scene": scene(), "operators": 3, "duration": 0.2, "seed": 11, "chunk": 3}
    return OperatorStudy(**{**asked, **changes})


def operators(worlds=1, **values):
    """(W, parameters) of operators in the middle of the population, but for `values`, numbers or (W)."""
    population = load_population()
    rows = np.tile(population.middle(), (worlds, 1))
    for name, value in values.items():
        rows[:, population.names.index(name)] = value
    return rows


PERFECT = {"motor_noise": 0.0, "hand_lag": 0.0, "pace": 1.0, "lag_threshold": 100.0, "preview": 2.0}
"""Makes no mistake: no noise, both hands together, sees far ahead. One that nobody is."""


def loop_of(values, *, feels=0, seed=1, device="cpu", **task):
    """The worlds of operators (W, parameters) at the shipped task."""
    population = load_population()
    asked = task_of(scene(), population, **task)
    count = len(values)
    rows = persons(
        population, values, asked, PERIOD, number=np.arange(count, dtype=np.uint32), feels=np.broadcast_to(feels, count)
    )
    return Loop(asked, rows, seed=seed, device=device)


class HandsAlone:
    """The operators of a loop, moved by forces and sights of a test instead of its chain and its physics."""

    def __init__(self, loop):
        self.loop, self.people = loop, loop.people
        shape = loop.people.mind.position.shape
        self.force = wp.zeros(shape, dtype=wp.vec3d, device=loop.sim.model.device)
        self.hand = wp.zeros(shape, dtype=wp.vec3d, device=loop.sim.model.device)
        self.done = wp.zeros(shape[0], dtype=wp.int32, device=loop.sim.model.device)

    def step(self, periods=1, *, force=None, error=None):
        """Servo periods with a force (W, H, 3) on the hands [N] and a seen error [m]; the hands, (W, H, 3) [m]."""
        for array, value in ((self.force, force), (self.people.sight.error, error)):
            if value is not None:
                array.assign(np.broadcast_to(value, (*array.shape, 3)).astype(float))
        people = self.people
        inputs = [self.loop.sim.model.data, people.task, people.people, people.sight, people.mind, people.account]
        for _ in range(periods):
            self.loop.launch(self.loop.operate, len(self.done), *inputs, self.done, self.force, self.hand)
        return self.hand.numpy().copy()
