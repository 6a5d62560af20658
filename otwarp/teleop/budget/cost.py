"""What a scene costs on this machine: the real simulation, run for a moment, frames read out as in a session."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Protocol

import numpy as np

from otwarp.record.run import capture_frame
from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation

FRAME_RATE = 120.0
"""Frames per second of wall time that a session reads out, see `frame.PaceNow`."""

SECONDS = 0.5
"""Wall time that one measurement takes at least [s], start-up excepted."""

BATCHES = 5
"""Parts of a measurement, of whose means the median counts: new neighbour lists are part of every mean, and a neighbour
on the machine that takes the core for a moment is not part of the median."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What one scene costs.

    Attributes:
        bodies: How many move.
        driver: Of the step, see `Features`.
        time_step: [s].
        largest_stable: Largest stable step [s].
        error: Larger of the predicted relative errors of variances and of relaxation rates, in the stiffest mode.
        chosen_by: What decided the time step.
        step: Wall time of a step [s].
        frame: Wall time of reading out a frame [s].
        ready: Wall time until the first frame was read: model, and kernels that were not in the cache [s].
    """

    bodies: int
    driver: str
    time_step: float
    largest_stable: float
    error: float
    chosen_by: str
    step: float
    frame: float
    ready: float = 0.0

    def load(self, speed: float, rate: float = FRAME_RATE) -> float:
        """Share of one core's time at `speed` simulated seconds per second and at most `rate` frames per second."""
        steps = speed / self.time_step
        return steps * self.step + min(rate, steps) * self.frame

    def speed(self, share: float, rate: float = FRAME_RATE) -> float:
        """Simulated seconds per second of wall time that a share of a core carries."""
        every_step = share / (self.step + self.frame)
        steps = every_step if every_step <= rate else (share - rate * self.frame) / self.step
        return steps * self.time_step


class Measure(Protocol):
    """Whatever says what a scene costs."""

    def __call__(self, scene: Scene, *, device: str | None, speed: float, rate: float) -> Cost:
        """See `measure_scene`."""
        ...


def measure_scene(
    scene: Scene,
    *,
    device: str | None = None,
    speed: float = 1.0,
    rate: float = FRAME_RATE,
    glide: float | None = None,
    seconds: float = SECONDS,
    clock: Callable[[], float] = time.perf_counter,
) -> Cost:
    """Run a scene from its start for a moment, on one thread, one world.

    What changes in the course of a session is not foreseen: bodies that come to touch each other later cost more.

    Args:
        speed: Simulated seconds per second that the session wants; decides how many steps lie between two frames.
        rate: Frames per second of wall time.
        glide: Simulated seconds after which traps are put anew, as moving hands do; None for traps that nobody moves.
        seconds: How long to measure [s].
        clock: Seconds, for tests.

    Raises:
        InputError: No simulation can be made of the scene.
        SimulationError: Its state did not stay physical.
    """
    begun = clock()
    sim = Simulation(scene, device=device, threads=1)
    steps = max(1, round(speed / rate / sim.time_step))
    moving = glide is not None and len(scene.traps) > 0
    part = max(1, round(glide / sim.time_step)) if glide is not None and moving else steps
    place = np.array([trap.position.at(0.0) for trap in scene.traps])
    sim.step()
    capture_frame(sim)
    ready = clock() - begun
    means: list[tuple[float, float]] = []
    for _ in range(BATCHES):
        stepping = reading = 0.0
        frames = 0
        while frames == 0 or stepping + reading < seconds / BATCHES:
            before = clock()
            for done in range(0, steps, part):
                if moving:
                    sim.control.set(trap_position=place)
                sim.step(min(part, steps - done))
            between = clock()
            capture_frame(sim)
            stepping, reading, frames = stepping + between - before, reading + clock() - between, frames + 1
        means.append((stepping / (frames * steps), reading / frames))
    scales = sim.model.scales
    return Cost(
        bodies=len(scene.bodies),
        driver=sim.model.features.driver,
        time_step=sim.time_step,
        largest_stable=scales.largest_stable,
        error=max(abs(scales.variance_error), abs(scales.rate_error)),
        chosen_by=scales.chosen_by,
        step=median(m[0] for m in means),
        frame=median(m[1] for m in means),
        ready=ready,
    )
