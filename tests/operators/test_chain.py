"""The batched chain against the servo's: the same hands, devices and states, and the same forces, period by period."""

from __future__ import annotations

import dataclasses
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp

from otwarp.errors import InputError
from otwarp.haptics.chain.passivity import MEMORY, REFILL
from otwarp.haptics.core.config import CouplingConfig, HandConfig, LowPass
from otwarp.haptics.force.law import IsotropicLaw, Law, TableLaw
from otwarp.operators.chain import ChainBatch
from otwarp.scene import Scene
from otwarp.simulation.model import Model
from otwarp.teleop.operators import HandPlan, LocalScene, plan_hands
from tests.haptics.setups import RADIAL
from tests.operators.motions import Turmoil
from tests.operators.twins import ON_DEVICES, ROUNDING, Twins
from tests.reference.tables import BEAMS, made_up_table

SCENES = Path(__file__).resolve().parents[2] / "scenes"
DEVICES = {"left": "virtual", "right": "virtual"}
TRAPS = 6
ALL = np.ones(3, dtype=bool)


@pytest.fixture(scope="module")
def delivery() -> tuple[Scene, LocalScene]:
    """Two robots in six traps of split laws, three for each hand; spheres of three kinds."""
    scene = Scene.load(SCENES / "cell_delivery.usda")
    return scene, LocalScene.of(Model.build(scene, device="cpu"), range(TRAPS))


def plans_for(
    scene: Scene,
    *,
    mode: str = "stable",
    hand: dict[str, Any] | None = None,
    safety: dict[str, Any] | None = None,
    **chain: Any,
) -> tuple[HandPlan, ...]:
    """Both hands of the scene, with changes of themselves, their safety and their chains."""
    changed = []
    for plan in plan_hands(scene, DEVICES, mode=mode):
        config = plan.config
        parts = {"chain": replace(config.chain, **chain), "safety": replace(config.safety, **(safety or {}))}
        changed.append(HandPlan("virtual", replace(config, **parts, **(hand or {}))))
    return tuple(changed)


def felt_otherwise(local: LocalScene) -> LocalScene:
    """The scene with a curve, a bilinear and a bicubic table of random nodes in place of its laws."""
    laws: list[Law] = [IsotropicLaw(RADIAL, equilibrium=0.3)]
    laws += [TableLaw.of(made_up_table(BEAMS[0], how, n)) for n, how in enumerate(("bilinear", "bicubic"))]
    turned = {trap: tuple(random.Random(trap).sample(laws, 3)) for trap in range(TRAPS)}
    return dataclasses.replace(local, laws=turned)


def rounding(device: str) -> float:
    """Largest difference from the servo's own chain that is allowed there."""
    return ROUNDING if device == "cpu" else ON_DEVICES


CASES: dict[str, dict[str, Any]] = {
    "stable": {},
    "paper": {"mode": "paper", "distance_damping": 0.01, "safety": {"dead_man": True}},
    "everything": {
        "motion_filter": LowPass(alpha=0.1, rate=1000.0),
        "force_filter": LowPass(alpha=0.3, rate=1000.0),
        "pose_filter": LowPass(alpha=0.2, rate=1000.0),
        "coupling": CouplingConfig(stiffness=300.0, damping=1.0),
        "damping": 0.5,
        "trap_speed": 20.0,
        "quantum": 0.0,
        "safety": {"dead_man": True, "ramp_time": 0.0},
    },
    "nothing": {
        "passivity": None,
        "pose_prediction": False,
        "quantum": 0.0,
        "hand": {"absolute": True, "clutch": False, "force_gain": 0.002},
    },
}


@pytest.mark.parametrize(
    "case", [pytest.param(c, marks=[pytest.mark.quick] if c == "everything" else []) for c in CASES]
)
def test_it_is_the_servos_chain(case, delivery, device):
    """Three worlds of two hands through 2000 periods of all that may happen; "nothing" with tables."""
    scene, local = delivery
    plans = plans_for(scene, **CASES[case])
    twins = Twins(plans, felt_otherwise(local) if case == "nothing" else local, 3, TRAPS, device)
    twins.gain[1, 0] = 0.0
    twins.arm(ALL)
    Turmoil(twins, seed=5).run(2000)
    assert max(twins.worst.values()) <= rounding(device), twins.worst
    assert {state for state, _ in twins.seen} >= {"disarmed", "armed", "decaying", "fault"}
    assert len({complaint for _, complaint in twins.seen}) >= 4


@pytest.mark.validate
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("speed", (0.01, 0.3))
def test_it_is_the_servos_chain_for_minutes(case, speed, delivery, device):
    """Seven worlds of two hands, slow and fast, through 20 s each."""
    scene, local = delivery
    plans = plans_for(scene, **CASES[case])
    twins = Twins(plans, felt_otherwise(local) if case == "nothing" else local, 7, TRAPS, device)
    twins.arm(np.ones(7, dtype=bool))
    Turmoil(twins, seed=11, speed=speed).run(20000)
    assert max(twins.worst.values()) <= rounding(device), twins.worst


def test_a_hand_that_rests_is_forgiven(delivery, device):
    """Of two worlds: a hand that was given what was foreseen, and one that a late cycle gave more; both then rest."""
    scene, local = delivery
    twins = Twins(plans_for(scene, safety={"ramp_time": 0.0}), local, 2, TRAPS, device)
    twins.arm(np.ones(2, dtype=bool))
    twins.sphere[:] = 0.4
    debt = np.zeros(2)
    for n in range(4600):
        if n % 8 == 0:
            twins.time[:] = 1e-3 * n
            twins.publish(np.ones(2, dtype=bool))
        force = twins.batch.force.numpy()
        along = force / np.maximum(np.linalg.norm(force, axis=-1, keepdims=True), 1e-12)
        if n < 300:  # the hands give way
            twins.hand += 5e-5 * along
        twins.elapsed[:] = 1e-3
        if n == 20:
            twins.elapsed[1] = 0.05
            twins.hand[1] += 0.02 * along[1]
        twins.period()
        if n == 300:
            debt = twins.batch.energy.numpy()[:, 0].copy()
    assert max(twins.worst.values()) <= rounding(device), twins.worst
    left = twins.batch.energy.numpy()[:, 0]
    assert -1e-4 < debt[0] < -5e-5 and left[0] - debt[0] == pytest.approx(2.0 * MEMORY * REFILL, rel=0.05)
    assert debt[1] < -1.1e-4 and left[1] == pytest.approx(0.0, abs=1e-6)


def test_hands_may_have_chains_that_differ(delivery, device):
    """The left one stable, the right one the release's."""
    scene, local = delivery
    plans = plans_for(scene)[0], plans_for(scene, **CASES["paper"], messages_per_state=1)[1]
    twins = Twins(plans, local, 3, TRAPS, device)
    twins.arm(ALL)
    Turmoil(twins, seed=6).run(400)
    assert max(twins.worst.values()) <= rounding(device), twins.worst
    forces = np.linalg.norm(twins.batch.asked.numpy(), axis=-1)
    assert np.all(forces.max(axis=0) > 1e-3)


def test_a_world_that_is_reset_is_a_new_chain(delivery, device):
    """And the others go on."""
    scene, local = delivery
    twins = Twins(plans_for(scene), local, 3, TRAPS, device)
    twins.arm(ALL)
    turmoil = Turmoil(twins, seed=7)
    for n in range(3):
        turmoil.run(150)
        some = np.arange(3) == n
        twins.reset(some)
        assert np.all(twins.batch.phase.numpy()[n] == 0) and not twins.batch.force.numpy()[n].any()
        twins.period()
        twins.arm(some)
    turmoil.run(100)
    assert max(twins.worst.values()) <= rounding(device), twins.worst


def still_batch(delivery: tuple[Scene, LocalScene], worlds: int, device: str) -> ChainBatch:
    """Armed hands of which world w moves by w millimetres per second, above a state at the origin."""
    scene, local = delivery
    batch = ChainBatch(plans_for(scene), local, worlds, device=device, traps=TRAPS)
    batch.power.fill_(20.0)
    batch.arm()
    batch.refresh(0.0)
    return batch


def moved(batch: ChainBatch, n: int) -> None:
    """Put the hands of all worlds where they are in period n."""
    place = np.zeros((*batch.hand.shape, 3))
    place[..., 1] = 1e-6 * n * np.arange(len(place))[:, None]
    batch.hand.assign(place)


def test_results_do_not_depend_on_the_number_of_worlds(delivery, device):
    few, many = still_batch(delivery, 2, device), still_batch(delivery, 5, device)
    for n in range(60):
        for batch in (few, many):
            moved(batch, n)
            if n % 8 == 0:
                batch.refresh(1e-3 * n)
            batch.step()
    for name in ("force", "asked", "commanded", "energy"):
        assert np.array_equal(getattr(few, name).numpy(), getattr(many, name).numpy()[:2]), name
    assert np.linalg.norm(few.force.numpy()[1, 0]) > 1e-4


def test_periods_and_states_go_into_a_graph(delivery, device):
    """Recorded once with the state's time in an array; replayed, it is what calls one by one give."""
    called, replayed = still_batch(delivery, 2, device), still_batch(delivery, 2, device)

    def turn(batch: ChainBatch) -> None:
        batch.refresh()
        for _ in range(4):
            batch.step()

    with wp.ScopedCapture(device=device) as capture:
        turn(replayed)
    for n in range(20):
        for batch in (called, replayed):
            moved(batch, 4 * n)
            batch.time.fill_(4e-3 * n)
        turn(called)
        wp.capture_launch(capture.graph)
    assert np.array_equal(called.force.numpy(), replayed.force.numpy())
    assert np.linalg.norm(called.force.numpy()[1, 0]) > 1e-4


def test_orders_reach_the_worlds_that_are_meant(delivery, device):
    batch = still_batch(delivery, 3, device)
    batch.disarm()
    batch.step()
    batch.arm(wp.array([False, True, False], dtype=wp.bool, device=device))
    batch.step()
    assert batch.phase.numpy().tolist() == [[0, 0], [1, 1], [0, 0]]
    batch.disarm(wp.array([True, True, False], dtype=wp.bool, device=device))
    batch.step()
    assert batch.phase.numpy().tolist() == [[0, 0]] * 3


def test_a_trap_that_nobody_holds_is_commanded_where_it_is(delivery):
    scene, local = delivery
    batch = ChainBatch(plans_for(scene)[:1], local, 1, device="cpu", traps=TRAPS + 1)
    batch.trap.assign(np.arange(3.0 * (TRAPS + 1)).reshape(1, -1, 3))
    batch.refresh(0.0)
    assert np.array_equal(batch.commanded.numpy(), batch.trap.numpy())
    batch.step()
    assert batch.holds.numpy().tolist() == [[1]]
    batch.hand.fill_(wp.vec3d(0.0, 1e-3, 0.0))
    batch.step()
    went = batch.commanded.numpy()[0] - batch.trap.numpy()[0]
    assert np.allclose(went[:3], [0.0, 0.0, 0.1]) and not went[3:].any()  # up the beam, 100 µm/m


REFUSALS = {
    "plans is empty": lambda plans, local: ChainBatch([], local, 1, device="cpu"),
    "worlds is 0": lambda plans, local: ChainBatch(plans, local, 0, device="cpu"),
    "infos has 1 devices": lambda plans, local: ChainBatch(plans, local, 1, device="cpu", infos=[None]),
    "traps is 5": lambda plans, local: ChainBatch(plans, local, 1, device="cpu", traps=5),
    "device is 'tpu'": lambda plans, local: ChainBatch(plans, local, 1, device="tpu"),
    "hand.traps has 9": lambda plans, local: ChainBatch(with_hand(plans, traps=(9,)), local, 1, device="cpu"),
    "hand 'left' has no traps": lambda plans, local: ChainBatch(with_hand(plans, traps=()), local, 1, device="cpu"),
    "hands have the traps": lambda plans, local: ChainBatch([*plans[:1], *plans[:1]], local, 1, device="cpu"),
    "chain.rate of the hands": lambda plans, local: ChainBatch([at_rate(plans[0], 500.0), plans[1]], local, 1),
}


def with_hand(plans: tuple[HandPlan, ...], **changes: Any) -> list[HandPlan]:
    """The first hand, changed."""
    return [HandPlan("virtual", replace(plans[0].config, **changes))]


def at_rate(plan: HandPlan, rate: float) -> HandPlan:
    """A hand with another servo rate."""
    config: HandConfig = plan.config
    return HandPlan("virtual", replace(config, chain=replace(config.chain, rate=rate)))


@pytest.mark.parametrize("says", REFUSALS)
def test_refuses_in_one_line(says, delivery):
    scene, local = delivery
    with pytest.raises(InputError, match=says) as caught:
        REFUSALS[says](plans_for(scene), local)
    assert "allowed: " in str(caught.value) and "\n" not in str(caught.value)


def test_refuses_a_table_in_paper_mode(delivery):
    scene, local = delivery
    with pytest.raises(InputError, match=r"chain\.mode is 'paper' with traps"):
        ChainBatch(plans_for(scene, mode="paper"), felt_otherwise(local), 1, device="cpu")
