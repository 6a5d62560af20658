"""Perception and servo chains without a liquid: spheres stand where a test has put them, traps where hands command."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from otwarp.haptics.core.config import LowPass
from otwarp.operators.chain import ChainBatch, zeros
from otwarp.operators.kernels import fidelity
from otwarp.operators.kernels.fidelity import FidelityData
from otwarp.operators.kernels.types import SightData
from otwarp.operators.perception.errors import perception_rows
from otwarp.operators.perception.loop import fidelity_of
from otwarp.operators.perception.sensing import Sensing
from otwarp.scene import Scene
from otwarp.simulation.model import Model
from otwarp.teleop.operators import HandPlan, LocalScene, plan_hands

SCENE = Path(__file__).resolve().parents[3] / "scenes" / "cell_delivery.usda"
PERIOD = 1e-3
POWER = 20.0
"""Of all traps [mW]."""


def delivery():
    """Two robots in six traps, three for each hand."""
    scene = Scene.load(SCENE)
    return scene, LocalScene.of(Model.build(scene, device="cpu"), range(len(scene.traps)))


def plans_of(scene, *, mode="stable", motion_gain=1000.0, **changes):
    """Both hands, whose force is full at once; in paper mode without filters, and without damping."""
    if mode == "paper":
        changes = {"motion_filter": None, "force_filter": LowPass(alpha=1.0, rate=1000.0), "damping": 0.0, **changes}
    plans = plan_hands(scene, {"left": "virtual", "right": "virtual"}, mode=mode, motion_gain=motion_gain)
    configs = (plan.config for plan in plans)
    return tuple(
        HandPlan("virtual", replace(c, chain=replace(c.chain, **changes), safety=replace(c.safety, ramp_time=0.0)))
        for c in configs
    )


class Stand:
    """W worlds of chains that are given estimates, and beside them perfect ones.

    Args:
        parts: `delivery()`.
        plans: Of the hands.
        perceptions: (W).
        number: (W) keys of their random numbers; None for one after the other.
    """

    def __init__(self, parts, plans, perceptions, *, number=None, seed=5, device="cpu"):
        scene, local = parts
        self.worlds, traps = len(perceptions), len(scene.traps)
        number = np.arange(self.worlds) if number is None else number
        self.chain, self.reference = (
            ChainBatch(plans, local, self.worlds, device=device, traps=traps) for _ in range(2)
        )
        self.device = self.chain.device
        self.sight: tuple[Any, Any] = SightData(), SightData()
        for sight in self.sight:
            sight.error = zeros((self.worlds, len(plans)), wp.vec3d, self.device)
            sight.lag = zeros((self.worlds,), wp.float64, self.device)
        self.done = zeros((self.worlds,), wp.int32, self.device)
        self.tick = zeros((self.worlds,), wp.int32, self.device)
        self.sums = FidelityData()
        for name, var in FidelityData.vars.items():
            setattr(self.sums, name, zeros(self.chain.force.shape, var.type.dtype, self.device))
        self.sensing = Sensing(
            self.chain, self.reference, perception_rows(perceptions, number, 1.0 / PERIOD),
            np.unique(local.bodies, return_inverse=True)[1], seed=seed, rate=1.0 / PERIOD, eyes=self.sight,
            held=np.full(traps, -1, dtype=np.int32), point=np.zeros((traps, 3)), eye_rate=120.0,
        )  # fmt: skip
        self.reference.power.fill_(POWER)
        self.reference.trap.assign(np.tile([t.position.at(0.0) for t in scene.traps], (self.worlds, 1, 1)))

    def begin(self, sphere):
        """Start with spheres at places that go into (W, S, 3) [µm]."""
        shape = (*self.reference.sphere.shape, 3)
        self.reference.sphere.assign(np.broadcast_to(np.asarray(sphere, dtype=float), shape))
        self.sensing.begin()
        self.reference.refresh(0.0)
        for chain in (self.chain, self.reference):
            chain.arm()

    def period(self, hand=None, sphere=None):
        """One servo period with hands (W, H, 3) [m], at whose end the spheres are somewhere else."""
        if hand is not None:
            self.chain.hand.assign(hand)
            self.reference.hand.assign(hand)
        self.chain.step()
        self.reference.step()
        self.tick.assign(self.tick.numpy() + 1)
        inputs = [self.chain.force, self.reference.force, self.chain.force_gain, self.tick, 10.0, 1.0, self.sums]
        wp.launch(fidelity.compare, dim=self.chain.force.shape, inputs=inputs, device=self.device)
        wp.copy(self.reference.trap, self.chain.commanded)
        if sphere is not None:
            self.reference.sphere.assign(sphere)
        self.sensing.period(self.done)
        self.reference.refresh(self.sensing.served.now)

    def fidelity(self):
        """As `PerceivedLoop.fidelity`."""
        return fidelity_of(self.sums, self.chain.force_gain.numpy(), PERIOD)
