"""What a scene costs on this machine, and what the budget did to it, as lines to print and as JSON.

The cost is measured: the real simulation, run for a moment, frames read out as in a session.
"""

from __future__ import annotations

import dataclasses
import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any, Protocol

import numpy as np

from otwarp.scene import Scene
from otwarp.simulation.frame import capture_frame
from otwarp.simulation.simulation import Simulation

FRAME_RATE = 120.0
"""Frames per second of wall time that a session reads out, see `otwarp.teleop.PaceNow`."""

SECONDS = 0.5
"""Wall time that one measurement takes at least [s], start-up excepted."""

BATCHES = 5
"""Parts of a measurement, of whose means the median counts: new neighbour lists are part of every mean, and a neighbour
on the machine that takes the core for a moment is not part of the median."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneCost:
    """What one scene costs.

    Attributes:
        bodies: How many move.
        driver: Of the step, see `Features`.
        time_step: [s].
        largest_stable: Largest stable step [s].
        error: Largest estimated relative error of what the time step may make wrong.
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

    def __call__(self, scene: Scene, *, device: str | None, speed: float, rate: float) -> SceneCost:
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
) -> SceneCost:
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
    return SceneCost(
        bodies=len(scene.bodies),
        driver=sim.model.features.driver,
        time_step=sim.time_step,
        largest_stable=scales.largest_stable,
        # gaps in contact are reported and no step is shortened for them: neither is a session's
        error=max((abs(e) for name, e in scales.errors.items() if name != "contact"), default=0.0),
        chosen_by=scales.chosen_by,
        step=median(m[0] for m in means),
        frame=median(m[1] for m in means),
        ready=ready,
    )


@dataclass(frozen=True, kw_only=True)
class BudgetReport:
    """What was kept, frozen and dropped, what it cost before and after, and how fast it will run.

    Attributes:
        budget: As asked for: `auto`, `off`, or a share.
        share: Of a core that the simulation may take.
        rate: Frames per second of wall time.
        speed_asked: Simulated seconds per second that were wanted.
        speed: That the session is to run at: what was wanted, or less if nothing else made it fit.
        bodies: Of the scene as loaded.
        kept: How many of them move.
        frozen: Names of those that became obstacles.
        left: Names of those that are not there any more.
        before, after: Cost of the scene as loaded, and as it will run; None where nothing was measured.
        accuracy: Wanted error before and after [1].
        reach: What counted as within reach: `anchor`, and `sweep` [µm], `carried` [µm], `horizon` [s].
        nearest: How far beyond reach the nearest body is that moves no more [µm].
        log: What was measured, in order.
    """

    budget: str | float
    share: float
    rate: float
    speed_asked: float
    speed: float
    bodies: int
    kept: int
    frozen: tuple[str, ...]
    left: tuple[str, ...]
    before: SceneCost | None
    after: SceneCost | None
    accuracy: tuple[float, float]
    reach: dict[str, float | str] | None
    nearest: float | None
    log: tuple[str, ...]

    @classmethod
    def off(cls, scene: Scene, speed: float) -> BudgetReport:
        """The report of a session without a budget: nothing was measured or left out."""
        count = len(scene.bodies)
        return cls(
            budget="off",
            share=1.0,
            rate=FRAME_RATE,
            speed_asked=speed,
            speed=speed,
            bodies=count,
            kept=count,
            frozen=(),
            left=(),
            before=None,
            after=None,
            accuracy=(scene.settings.accuracy, scene.settings.accuracy),
            reach=None,
            nearest=None,
            log=(),
        )

    @property
    def fits(self) -> bool:
        """Whether the wanted speed is kept."""
        return self.speed >= self.speed_asked

    @property
    def reduced(self) -> bool:
        """Whether the scene is not as it was loaded."""
        return bool(self.frozen or self.left) or self.accuracy[0] != self.accuracy[1]

    def lines(self, *, log: bool = False) -> list[str]:
        """What a user should read; with `log` also what was measured on the way."""
        if self.before is None or self.after is None:
            return ["budget off: nothing was measured, nothing was left out"]
        found = [f"budget {self.budget}: {100.0 * self.share:g} % of one core for the simulation"]
        found += [f"  measured {line}" for line in self.log] if log else []
        found.append(f"as loaded: {self._cost_line(self.before, self.speed_asked)}")
        if not self.reduced and self.fits:
            return [*found, f"{self._all_stay()}, nothing was left out"]
        found += self._body_lines()
        if self.accuracy[0] != self.accuracy[1]:
            found.append(
                f"accuracy lowered from {100.0 * self.accuracy[0]:g} % to {100.0 * self.accuracy[1]:g} %: time step "
                f"{1e6 * self.before.time_step:.4g} → {1e6 * self.after.time_step:.4g} µs (stable below "
                f"{_micro(self.after.largest_stable)}), predicted error {100.0 * self.after.error:.2g} %"
            )
        if self.reduced:
            found.append(f"as it will run: {self._cost_line(self.after, self.speed)}")
        if not self.fits:
            found.append(
                f"real time does not fit: slow motion at {self.speed:g} of {self.speed_asked:g} simulated seconds per "
                "second; simulated time does not slip"
            )
        return found

    def _all_stay(self) -> str:
        return "the only body stays" if self.bodies == 1 else f"all {self.bodies} bodies stay"

    def _cost_line(self, cost: SceneCost, speed: float) -> str:
        return (
            f"{cost.bodies} moving, {100.0 * cost.load(speed, self.rate):.3g} % of a core at {speed:g}× speed; a whole "
            f"core would reach {cost.speed(1.0, self.rate):.3g}× real time"
        )

    def _body_lines(self) -> list[str]:
        """Bodies, and why."""
        out = len(self.frozen) + len(self.left)
        if not out or self.reach is None:
            return [self._all_stay()]
        anchor = self.reach["anchor"]
        if anchor == "traps":
            near = "–" if self.nearest is None else f"{self.nearest:.3g} µm"
            sweep, carried, horizon = (self.reach[name] for name in ("sweep", "carried", "horizon"))
            rule = (
                f"beyond what the traps reach: {sweep:g} µm from their paths, and {carried:.3g} µm of what they carry, "
                f"in {horizon:g} s; the nearest by {near}"
            )
        else:
            rule = f"farthest from {anchor}, for the scene has no traps"
        names = " ".join(part for part in (_short("frozen", self.frozen), _short("left out", self.left)) if part)
        found = [f"{self.kept} of {self.bodies} bodies stay; {names}", f"  ({rule})"]
        if self.frozen:
            found.append("  (a frozen cell is a wall to what touches it: rigid, immovable, without adhesion)")
        return found

    def to_json(self) -> dict[str, Any]:
        """For a program; bodies of a PointInstancer as the list of their indices."""
        data = dataclasses.asdict(self)
        for name in ("frozen", "left"):
            data[name] = _grouped(getattr(self, name))
        for name in ("before", "after"):
            cost = getattr(self, name)
            if cost is not None:
                speed = self.speed_asked if name == "before" else self.speed
                stable = cost.largest_stable if math.isfinite(cost.largest_stable) else None
                data[name] |= {
                    "largest_stable": stable,
                    "load": cost.load(speed, self.rate),
                    "real_time_factor": cost.speed(1.0, self.rate),
                }
        return data | {"fits": self.fits, "reduced": self.reduced, "lines": self.lines()}


def _micro(seconds: float) -> str:
    return f"{1e6 * seconds:.4g} µs" if math.isfinite(seconds) else "any length"


def _grouped(names: tuple[str, ...]) -> dict[str, list[int] | None]:
    """Bodies by prim: the indices of its instances, None for a body of its own."""
    found: dict[str, list[int] | None] = {}
    for name in names:
        match = re.fullmatch(r"(.*)\[(\d+)\]", name)
        if match is None:
            found[name] = None
        else:
            indices = found.setdefault(match[1], [])
            if indices is not None:
                indices.append(int(match[2]))
    return found


def _short(what: str, names: tuple[str, ...]) -> str:
    """How many, and of which prims."""
    if not names:
        return ""
    groups = [name if rows is None else f"{name}[{len(rows)}]" for name, rows in _grouped(names).items()]
    more = f" and {len(groups) - 3} more" if len(groups) > 3 else ""
    return f"{what}: {len(names)} ({', '.join(groups[:3])}{more})"
