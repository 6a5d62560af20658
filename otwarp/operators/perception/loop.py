"""The loop of SIMULATED operators with perception between the state and what chains and eyes get of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import warp as wp

from otwarp.operators.chain import ChainBatch, zeros
from otwarp.operators.kernels import fidelity, perception, seen
from otwarp.operators.kernels.fidelity import FidelityData
from otwarp.operators.kernels.types import SightData
from otwarp.operators.loop import Loop
from otwarp.operators.perception.errors import Perception, perception_rows
from otwarp.operators.perception.sensing import Sensing
from otwarp.operators.task import Task
from otwarp.teleop.operators import LocalScene

DIRECTED = 1.0
"""Force at the specimen from which on its direction counts [pN]."""


class PerceivedLoop(Loop):
    """Simulated operators who are given estimates, a world each.

    Args:
        task, persons: As of `Loop`; `persons` know of their displays' delays, see `errors.Perception`.
        perceptions: (W), of the worlds.
        options: As of `Loop`; its frame rate is that of a microscope.

    Attributes:
        reference: Chains moved by the same hands, which get the state as it is every servo period.
        sums: `FidelityData`.
    """

    def __init__(self, task: Task, persons: np.ndarray, perceptions: Sequence[Perception], **options: Any):
        rate = task.plans[0].config.chain.rate
        self.rows = perception_rows(perceptions, persons["number"], rate)
        self.seed = options.get("seed", 0)
        super().__init__(task, persons, **options)
        self.reference.arm()

    def prepare(self, local: LocalScene) -> None:
        """Make perfect chains beside the operators', and what is between the state and these."""
        worlds, device, plans = len(self.rows), self.sim.model.device, self.task.plans
        self.reference = ChainBatch(plans, local, worlds, device=device, traps=len(self.task.scene.traps))
        self.reference.force_gain.assign(self.chain.force_gain)
        self.twin = self.twin_of(self.reference)
        self.truth_sight = SightData()
        for name in SightData.vars:
            setattr(self.truth_sight, name, wp.zeros_like(getattr(self.people.sight, name)))
        self.sums = FidelityData()
        for name, var in FidelityData.vars.items():
            setattr(self.sums, name, zeros((worlds, len(plans)), var.type.dtype, device))
        held, point = self._held()
        robot = np.unique(self.twin.body.numpy(), return_inverse=True)[1]
        self.sensing = Sensing(
            self.chain, self.reference, self.rows, robot, seed=self.seed, rate=self.rate,
            eyes=(self.truth_sight, self.people.sight), held=held, point=point, eye_rate=self.frame_rate,
        )  # fmt: skip

    def _held(self) -> tuple[np.ndarray, np.ndarray]:
        """(T) sphere that each trap of a hand holds, −1 for none, and (T, 3) where, from its focus [µm]."""
        traps, hand = self.sim.model.data.traps, self.people.task.hand_of.numpy()
        body, offset = self.twin.body.numpy(), self.twin.offset.numpy()
        held_body, held_offset = traps.held_body.numpy(), traps.held_offset.numpy()
        point = traps.equilibrium.numpy()[:, None] * traps.axis.numpy()
        held = np.full(len(hand), -1, dtype=np.int32)
        for t in np.flatnonzero((hand >= 0) & (held_body >= 0)):
            apart = np.linalg.norm(offset - held_offset[t], axis=1) + np.where(body == held_body[t], 0.0, np.inf)
            held[t] = int(np.argmin(apart))
        return held, point.astype(float)

    def load(self) -> None:
        """Compile and load what a graph captures."""
        super().load()
        for kernel in (perception.perceive, perception.begin_perception, fidelity.compare):
            wp.load_module(kernel.module, device=self.sim.model.device)

    def act(self) -> None:
        """One servo period up to the traps, which the operators' chains command."""
        self.move_hands()
        self.chain.step()
        wp.copy(self.reference.hand, self.chain.hand)
        self.reference.step()
        self.command_traps()

    def keep_account(self) -> None:
        """Keep what a servo period did, and what can be known of it at its end."""
        super().keep_account()
        shape = self.chain.force.shape
        self.launch(
            fidelity.compare, shape, self.chain.force, self.reference.force, self.chain.force_gain,
            self.people.mind.tick, self.task.contact_warning, DIRECTED, self.sums,
        )  # fmt: skip
        self._see()
        self.sensing.period(self.sim.episodes.done)
        self.reference.refresh(self.sensing.served.now)

    def _see(self) -> None:
        """Have the state as it is, for estimates and perfect chains."""
        sim, people = self.sim, self.people
        self.launch(
            seen.see, sim.model.worlds, sim.model.data, sim.control.data(), sim.state.data(), people.task, people.mind,
            sim.episodes.done, self.twin, self.truth_sight,
        )  # fmt: skip

    def publish(self) -> None:
        """Give chains and eyes what they have at the start."""
        self._see()
        self.sensing.begin()
        self.reference.refresh(0.0)

    def run(self, duration: float) -> None:
        """Go on for so many seconds, to whole servo periods; worlds that are done stand still."""
        periods = round(duration * self.rate)
        self.turn(periods)
        self.ticks += periods

    def fidelity(self) -> Mapping[str, np.ndarray]:
        """How true the forces of trials were, (W) each, of all hands together; nan where nothing was to be felt.

        force_rmse [N] and force_rmse_pn [pN at the specimen]: root mean square of the error vector of a hand's force;
        force_r2: 1 − Σ|e|²/Σ|g − ḡ|², g the perfect force and ḡ its mean over the trial; direction_error [°], mean
        where g is above `DIRECTED`; warned, missed, false [s]: time in which the perfect force warns, in which it does
        and the felt one does not, and the other way round, per hand.
        """
        return fidelity_of(self.sums, self.chain.force_gain.numpy(), 1.0 / self.rate)


def fidelity_of(sums: Any, gain: np.ndarray, period: float) -> Mapping[str, np.ndarray]:
    """`PerceivedLoop.fidelity` from the sums of `FidelityData`, gains (W, H) [N/pN] and the servo's period [s]."""
    s = {name: getattr(sums, name).numpy() for name in FidelityData.vars}
    count = np.maximum(s["counted"], 1)
    spread = s["square"] - np.sum(s["total"] ** 2, axis=-1) / count
    with np.errstate(invalid="ignore", divide="ignore"):
        rmse = np.sqrt(s["error"].sum(axis=1) / count.sum(axis=1))
        own = np.sqrt(np.sum(s["error"] / gain**2, axis=1) / count.sum(axis=1))
        out = {
            "force_rmse": rmse,
            "force_rmse_pn": own,
            "force_r2": 1.0 - s["error"].sum(axis=1) / spread.sum(axis=1),
            "direction_error": np.rad2deg(s["angle"].sum(axis=1) / s["directed"].sum(axis=1)),
        }
    hands = gain.shape[1]
    for name, array in (("warned", "warned"), ("missed", "unwarned"), ("false", "alarmed")):
        out[name] = s[array].sum(axis=1) * period / hands
    felt = np.any(gain > 0.0, axis=1)
    return {name: np.where(felt, row, math.nan) for name, row in out.items()}
