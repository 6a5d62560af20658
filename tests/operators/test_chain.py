"""The batched chain against the servo's: the same hands, devices and states, and the same forces, period by period."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from otwarp.haptics.core.config import CouplingConfig, LowPass
from otwarp.scene import Scene
from otwarp.simulation.model import Model
from otwarp.teleop.operators import HandPlan, LocalScene, plan_hands
from tests.operators.motions import Turmoil
from tests.operators.twins import ROUNDING, Twins

SCENES = Path(__file__).resolve().parents[2] / "scenes"
DEVICES = {"left": "virtual", "right": "virtual"}
EVERYTHING = {
    "motion_filter": LowPass(alpha=0.1, rate=1000.0),
    "force_filter": LowPass(alpha=0.3, rate=1000.0),
    "pose_filter": LowPass(alpha=0.2, rate=1000.0),
    "coupling": CouplingConfig(stiffness=300.0, damping=1.0),
    "damping": 0.5,
    "trap_speed": 20.0,
    "quantum": 0.0,
}
NOTHING = {"passivity": None, "pose_prediction": False, "quantum": 0.0}


@pytest.fixture(scope="module")
def delivery() -> tuple[Scene, LocalScene]:
    """Two robots in six traps of split laws, three for each hand."""
    scene = Scene.load(SCENES / "cell_delivery.usda")
    return scene, LocalScene.of(Model.build(scene, device="cpu"), range(len(scene.traps)))


def plans_for(scene: Scene, *, mode: str = "stable", safety: dict[str, Any] | None = None, **changes: Any):
    """Both hands of the scene, with changes of their chains and their safety."""
    plans = plan_hands(scene, DEVICES, mode=mode)
    configs = (plan.config for plan in plans)
    return tuple(
        HandPlan("virtual", replace(c, chain=replace(c.chain, **changes), safety=replace(c.safety, **(safety or {}))))
        for c in configs
    )


CASES: dict[str, dict[str, Any]] = {
    "stable": {},
    "paper": {"mode": "paper", "distance_damping": 0.01, "safety": {"dead_man": True}},
    "everything": {**EVERYTHING, "safety": {"dead_man": True, "ramp_time": 0.0}},
}


@pytest.mark.parametrize("case", CASES)
def test_it_is_the_servos_chain(case, delivery):
    """Three worlds of two hands through 3000 periods of all that may happen."""
    scene, local = delivery
    plans = plans_for(scene, **CASES[case])
    twins = Twins(plans, local, 3, len(scene.traps))
    twins.gain[1, 0] = 0.0
    twins.arm(np.ones(3, dtype=bool))
    Turmoil(twins, seed=5, quantum=plans[0].config.chain.quantum).run(3000)
    print(case, twins.worst, sorted(twins.seen))
    assert max(twins.worst.values()) <= ROUNDING
    assert {state for state, _ in twins.seen} >= {"disarmed", "armed", "decaying", "fault"}
    assert len({complaint for _, complaint in twins.seen}) >= 4
