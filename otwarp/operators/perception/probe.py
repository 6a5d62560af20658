"""What delay and errors do to a force, probed: hands of SIMULATED operators that are moved in sines, or held still."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.operators.chain import zeros
from otwarp.operators.kernels import probing
from otwarp.operators.kernels.probing import DRIVEN, FREE, SINES, TRACKED, ProbeRow, ProbeSums
from otwarp.operators.kernels.types import YIELDS
from otwarp.operators.loop import FRAME_RATE, LONGEST_STEP
from otwarp.operators.people import persons
from otwarp.operators.perception.cycles import limit_cycles
from otwarp.operators.perception.errors import Perception
from otwarp.operators.perception.loop import PerceivedLoop
from otwarp.operators.population import Population
from otwarp.operators.task import Task

FREQUENCIES = (1.0, 5.0)
"""Of the two sines [Hz]."""
AMPLITUDES = (2.0, 0.4)
"""Of both, of the traps [µm]: the same speed, about that of a delivery."""
BEGUN = 1.0
"""Seconds before anything counts, for the ramp of the force and whatever dies away."""
KINDS = ("driven", "held")
"""What the hands of a world do: go in sines; are held still by the middle arm of the population."""


@dataclass(frozen=True, kw_only=True)
class Probing:
    """How long, and how often, perceptions are probed.

    Attributes:
        seconds: That count, whole periods of both sines.
        repeats: Worlds of each kind, with other random numbers.
        seed: Key of these.
        frame_rate: Of a microscope's pictures, for eyes [1/s].
        time_step: Of the physics, at most [s].
    """

    seconds: float = 4.0
    repeats: int = 2
    seed: int = 0
    frame_rate: float = FRAME_RATE
    time_step: float = LONGEST_STEP


class ProbeLoop(PerceivedLoop):
    """Hands that are probed, a world each.

    Args:
        task, persons, perceptions, options: As of `PerceivedLoop`.
        probes: (W) structs `ProbeRow`.
        samples: Places of each hand that are kept.
    """

    def __init__(
        self,
        task: Task,
        persons: np.ndarray,
        perceptions: Sequence[Perception],
        probes: np.ndarray,
        samples: int,
        **options: Any,
    ):
        self.probes, self.samples = probes, samples
        super().__init__(task, persons, perceptions, **options)

    def load(self) -> None:
        """Compile and load what a graph captures, and make room for the answers."""
        super().load()
        device, shape = self.sim.model.device, self.chain.force.shape
        wp.load_module(probing.probe.module, device=device)
        self.probe_rows = wp.array(self.probes, dtype=ProbeRow, device=device)
        self.answers = ProbeSums()
        self.answers.first = round(BEGUN * self.rate)
        more = {"force": (SINES,), "reference": (SINES,), "track": (self.samples,)}
        for name in ("counted", "force", "reference", "place", "square", "track"):
            setattr(self.answers, name, zeros((*shape, *more.get(name, ())), ProbeSums.vars[name].type.dtype, device))

    def move_hands(self) -> None:
        """What hands do in a servo period."""
        chain, people = self.chain, self.people
        self.launch(
            probing.probe, self.sim.model.worlds, self.probe_rows, people.people, 1.0 / self.rate, people.mind,
            self.sim.episodes.done, chain.force, chain.hand,
        )  # fmt: skip

    def keep_account(self) -> None:
        """Keep what a servo period did."""
        chain, tick = self.chain, self.people.mind.tick
        self.launch(
            probing.add_answer, chain.force.shape, self.probe_rows, 1.0 / self.rate, tick, chain.force,
            self.reference.force, chain.hand, self.answers,
        )  # fmt: skip
        super().keep_account()


def probe_rows(task: Task, kinds: Sequence[str]) -> np.ndarray:
    """(W) structs `ProbeRow` of hands that do what `kinds` say, names of `KINDS`; sines go along the scene's x."""
    out = np.zeros(len(kinds), dtype=np.dtype(ProbeRow.numpy_dtype()))  # type: ignore[arg-type]
    out["drive"] = [DRIVEN if kind == "driven" else FREE for kind in kinds]
    out["axis"] = np.array(task.plans[0].config.axis_map)[0]  # Aᵀ·x
    out["amplitude"] = np.array(AMPLITUDES) / task.motion_gain
    out["turning"] = 2.0 * np.pi * np.array(FREQUENCIES)
    return out


def probe_persons(task: Task, population: Population, number: np.ndarray) -> np.ndarray:
    """(W) structs `Person` in the middle of the population, with the keys `number` of their random numbers."""
    values = np.tile(population.middle(), (len(number), 1))
    period = 1.0 / task.plans[0].config.chain.rate
    return persons(population, values, task, period, number=number, feels=np.full(len(number), YIELDS))


def run_probes(
    task: Task,
    population: Population,
    perceptions: Sequence[Perception],
    probing: Probing | None = None,
    *,
    device: str | None = None,
) -> Mapping[str, np.ndarray]:
    """Probe perceptions, P of them: arrays (P, repeats, hands) or (P, repeats, hands, frequencies).

    phase [°] and gain [1]: of the force on a hand against that of a perfect, undelayed twin, at `FREQUENCIES`, for the
    same motion; a lag is below 0. sway [m]: root mean square of the place of a hand that an arm holds still, about its
    mean; noise makes it large as well as a limit cycle. cycle [Hz] and cycle_amplitude [m]: of its limit cycle, see
    `cycles`; nan and 0 where there is none. All are nan where a world was over before, as when a robot was lost.
    """
    ask = probing or Probing()
    count = len(perceptions) * ask.repeats
    kinds = np.repeat(KINDS, count)
    numbers = np.tile(np.arange(ask.repeats, dtype=np.uint32), len(KINDS) * len(perceptions))
    rate = task.plans[0].config.chain.rate
    loop = ProbeLoop(
        task,
        probe_persons(task, population, numbers),
        [p for _ in KINDS for p in perceptions for _ in range(ask.repeats)],
        probe_rows(task, list(kinds)),
        round(ask.seconds * rate) // TRACKED,
        seed=ask.seed,
        device=device,
        time_step=ask.time_step,
        frame_rate=ask.frame_rate,
    )
    loop.run(BEGUN + ask.seconds)
    return answers_of(loop.answers, loop.rate, len(perceptions), ask)


def answers_of(answers: Any, rate: float, count: int, ask: Probing) -> Mapping[str, np.ndarray]:
    """What `run_probes` gives of `count` perceptions, from the `ProbeSums` of all worlds at a servo's rate [1/s]."""
    sums = {name: getattr(answers, name).numpy() for name in ProbeSums.vars if name != "first"}
    whole = sums["counted"] == round(ask.seconds * rate)
    each = np.maximum(sums["counted"], 1)[..., None]
    mean = sums["place"] / each
    sway = np.where(whole, np.sqrt(np.maximum(np.sum(sums["square"] / each - mean**2, axis=-1), 0.0)), np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        answer = _complex(sums["force"]) / _complex(sums["reference"])
    answer = np.where(whole[..., None], answer, np.nan)
    shape = (len(KINDS), count, ask.repeats)
    driven = answer.reshape(*shape, *answer.shape[1:])[0]
    held = sway.reshape(*shape, *sway.shape[1:])
    frequency, amplitude = limit_cycles(sums["track"].reshape(*shape, *sums["track"].shape[1:])[1], rate / TRACKED)
    amplitude[~np.isfinite(held[1])] = np.nan
    return {"phase": np.rad2deg(np.angle(driven)), "gain": np.abs(driven), "sway": held[1],
            "cycle": np.where(np.isfinite(held[1]), frequency, np.nan), "cycle_amplitude": amplitude}  # fmt: skip


def _complex(sums: np.ndarray) -> np.ndarray:
    """Amplitudes of e^{iωt} from sums of f·(cos ωt, sin ωt), up to a factor that all have."""
    return sums[..., 0] - 1j * sums[..., 1]
