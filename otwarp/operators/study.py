"""A study of SIMULATED operators: who runs which trials under which conditions, and what is kept of each."""

from __future__ import annotations

import platform
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.operators import statistics
from otwarp.operators.kernels.types import NOTHING, RESPONDS, YIELDS
from otwarp.operators.loop import FRAME_RATE, LONGEST_STEP, Loop
from otwarp.operators.people import persons
from otwarp.operators.population import Population, load_population
from otwarp.operators.task import Task, task_of
from otwarp.scene import Scene
from otwarp.scene.digest import scene_digest

CONDITIONS = {"without": NOTHING, "with": RESPONDS, "no response": YIELDS}
"""Conditions by name: no haptics; haptics; haptics without the delayed response, the arm only yielding."""
LOOK = 0.25
"""Seconds between looks whether anybody is still at work."""
MOST_PRESSED = 100.0
"""Farthest that a hand may be asked to go beyond its path [µm]."""
CHUNK_CPU, CHUNK_GPU = 32, 2048
"""Operators that run at once where nothing else is asked for."""


@dataclass(frozen=True, eq=False, kw_only=True)
class OperatorStudy:
    """Simulated operators at a scene's task, each under all conditions with the same random numbers.

    Attributes:
        scene: Whose task it is.
        operators: How many; with `sobol` that many follow from it.
        seed: Key of all random numbers.
        mode: Haptic chain, `stable` or `paper`.
        force_gain, motion_gain: Of both hands [N/pN, µm/m]; None for the chain's, and the workspace's.
        duration: After which a trial is given up [s]; None for the population's patience.
        press: By how much farther towards the cell every hand aims than the scene's author [µm].
        conditions: Names of `CONDITIONS`.
        sobol: Rows of Saltelli's points for the indices of the parameters, a power of 2; 0 for a plain population.
        chunk: Operators that run at once; results do not depend on it.
        frame_rate: Pictures per second [1/s].
        time_step: Of the physics, at most [s].
        population: Who they are.

    Raises:
        InputError: Anything out of range, or a scene without such a task.
    """

    scene: Scene
    operators: int = 200
    seed: int = 0
    mode: str = "stable"
    force_gain: float | None = None
    motion_gain: float | None = None
    duration: float | None = None
    press: float = 0.0
    conditions: tuple[str, ...] = ("without", "with")
    sobol: int = 0
    chunk: int = CHUNK_CPU
    frame_rate: float = FRAME_RATE
    time_step: float = LONGEST_STEP
    population: Population = field(default_factory=load_population)

    def __post_init__(self) -> None:
        unknown = [name for name in self.conditions if name not in CONDITIONS]
        if unknown or not self.conditions:
            raise InputError(f"conditions hold {unknown[:1]!r}; allowed: {', '.join(CONDITIONS)}")
        for name, value, low in (("operators", self.operators, 1), ("chunk", self.chunk, 1), ("sobol", self.sobol, 0)):
            if int(value) != value or value < low:
                raise InputError(f"{name} is {value!r}; allowed: a whole number, {low} or more")
        if not abs(self.press) <= MOST_PRESSED:
            raise InputError(f"press is {self.press!r}; allowed: ±{MOST_PRESSED:g} µm")
        if self.sobol:
            statistics.saltelli(self.sobol, 1, 0)  # refuses what is no power of 2

    @cached_property
    def task(self) -> Task:
        """What they are asked to do."""
        return task_of(
            self.scene,
            self.population,
            mode=self.mode,
            motion_gain=self.motion_gain,
            force_gain=self.force_gain,
            duration=self.duration,
            press=self.press,
        )

    @property
    def count(self) -> int:
        """Operators in all."""
        return self.sobol * (len(self.population.parameters) + 2) if self.sobol else self.operators

    @property
    def chunks(self) -> int:
        """Parts that are computed at once."""
        return -(-self.count // self.chunk)

    def members(self, chunk: int) -> np.ndarray:
        """Numbers of the operators of a chunk."""
        return np.arange(chunk * self.chunk, min((chunk + 1) * self.chunk, self.count))

    def values(self, operators: np.ndarray) -> np.ndarray:
        """(n, parameters) of operators by their numbers."""
        if not self.sobol:
            return self.population.draw(self.seed, operators)
        parameters = len(self.population.parameters)
        points = statistics.saltelli(self.sobol, parameters, self.seed).reshape(-1, parameters)
        return self.population.at(points[operators])

    def numbers(self, operators: np.ndarray) -> np.ndarray:
        """(n) keys of the random numbers of operators: each his own, but all of a row of Saltelli's points the same."""
        parameters = len(self.population.parameters)
        return (operators // (parameters + 2) if self.sobol else operators).astype(np.uint32)

    def persons(self, operators: np.ndarray) -> np.ndarray:
        """(conditions · n) structs of operators, one condition after the other."""
        count = len(self.conditions)
        feels = np.repeat([CONDITIONS[name] for name in self.conditions], len(operators))
        rate = self.task.plans[0].config.chain.rate
        return persons(
            self.population,
            np.tile(self.values(operators), (count, 1)),
            self.task,
            1.0 / rate,
            number=np.tile(self.numbers(operators), count),
            feels=feels,
        )

    def loop(self, operators: np.ndarray, device: str | None) -> Loop:
        """The worlds of operators (n) at their start, on a device, one condition after the other."""
        return Loop(
            self.task,
            self.persons(operators),
            seed=self.seed,
            device=device,
            time_step=self.time_step,
            frame_rate=self.frame_rate,
        )

    def run_chunk(self, chunk: int, *, device: str | None = None) -> dict[str, np.ndarray]:
        """Trials of a chunk: arrays (conditions, n) by name, see `kept`."""
        operators = self.members(chunk)
        loop = self.loop(operators, device)
        while loop.running:
            loop.run(LOOK)
        return {name: row.reshape(len(self.conditions), -1) for name, row in kept(loop).items()}

    def asked(self) -> dict[str, Any]:
        """All that the results follow from, as JSON."""
        import warp

        import otwarp

        hand = self.task.plans[0].config
        return {
            "version": 1,
            "simulated": True,
            "scene": {"file": str(self.scene.file), "sha256": scene_digest(self.scene)},
            "population": self.population.sha256,
            "operators": self.count,
            "sobol": self.sobol,
            "seed": self.seed,
            "conditions": list(self.conditions),
            "chunk": self.chunk,
            "mode": self.mode,
            "force gain": hand.force_gain,
            "motion gain": hand.motion_gain,
            "duration": self.task.duration,
            "press": self.press,
            "frame rate": self.frame_rate,
            "time step": self.time_step,
            "versions": {"otwarp": otwarp.__version__, "warp": warp.__version__, "python": platform.python_version()},
        }


def kept(loop: Loop) -> dict[str, np.ndarray]:
    """What is kept of the trials of a loop that is over, (W) each.

    outcome: key of `task.OUTCOMES`; time [s]; contact_mean, contact_peak [pN] and contact_above [s], force on the cell
    and time above the scene's warning; distance_mean, distance_peak [µm] and distance_above [s], of held spheres from
    their traps; force_mean, force_peak [N] on a hand; work, work_peak [J] done on the hands; waited, slowed [s];
    progress [1] along the path; first_lost, index of the trap that lost its sphere first, −1 for none.
    """
    sim, account = loop.sim, loop.people.accounts()
    counted = np.maximum(account["counted"], 1)
    period = 1.0 / loop.rate
    escape = sim.last_readout.escape_step.numpy()
    never = np.iinfo(np.int64).max
    first = np.where(escape >= 0, escape, never)
    lost = np.where(first.min(axis=1, initial=never) < never, first.argmin(axis=1) if first.shape[1] else 0, -1)
    return {
        "outcome": sim.episodes.done.numpy().astype(np.int8),
        "time": sim.episodes.time,
        "contact_mean": account["contact"] / counted,
        "contact_peak": account["contact_peak"],
        "contact_above": account["contact_above"] * period,
        "distance_mean": account["distance"] / counted,
        "distance_peak": account["distance_peak"],
        "distance_above": account["distance_above"] * period,
        "force_mean": account["force"] / counted,
        "force_peak": account["force_peak"],
        "work": account["work"],
        "work_peak": account["work_peak"],
        "waited": account["waited"] * period,
        "slowed": account["slowed"] * period,
        "progress": loop.people.mind.progress.numpy() / loop.task.end,
        "first_lost": lost.astype(np.int8),
    }
