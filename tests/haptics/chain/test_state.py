"""A chain that goes on from what another remembered, by way of JSON, does what the other does; and so do its parts."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import pytest

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import OLD_NAMES, Chain
from otwarp.haptics.chain.motion import Motion, VectorFilter, VelocityEstimate, VirtualCoupling
from otwarp.haptics.chain.paper_mode import PaperForce, PaperRenderer
from otwarp.haptics.chain.passivity import Passivity
from otwarp.haptics.chain.safety import Safety
from otwarp.haptics.core import DeviceSample, SceneFrame, SphereFrame, TrapFrame, Vec3, scene_from_list
from otwarp.haptics.core.config import CouplingConfig, HandConfig, LowPass, PassivityConfig, SafetyConfig
from otwarp.haptics.force import LocalModel
from otwarp.haptics.force.law import IsotropicLaw, SplitLaw
from tests.haptics.setups import AXIAL, PERIOD, RADIAL, hand_config, make_chain, random_motion

CONFIGS = {
    "plain": {},
    "full": {
        "coupling": CouplingConfig(),
        "motion_filter": LowPass(alpha=0.1, rate=1000.0),
        "force_filter": LowPass(alpha=0.3, rate=1000.0),
        "pose_filter": LowPass(alpha=0.05, rate=1000.0),
        "pose_prediction": True,
        "quantum": 5.5e-5,
        "damping": 0.5,
    },
    "absolute": {"absolute": True, "dead_man": True, "trap_speed": 50.0},
    "paper": {"mode": "paper", "force_filter": LowPass(alpha=0.05, rate=120.0), "damping": 1.0, "passivity": None},
}


def through_json(state: Any) -> Any:
    return json.loads(json.dumps(state))


def scene(rng: random.Random, beat: int) -> SceneFrame:
    t = 0.008 * beat
    spheres = tuple(SphereFrame((rng.gauss(0.3, 0.1), rng.gauss(0.0, 0.1), 0.0), n) for n in range(3))
    return SceneFrame(beat, t, spheres, (TrapFrame(0, (0.1, 0.0, 0.0), 20.0),))


def vector(rng: random.Random, scale: float = 1.0) -> Vec3:
    return rng.gauss(0.0, scale), rng.gauss(0.0, scale), rng.gauss(0.0, scale)


def step_safety(part: Safety, rng: random.Random) -> Any:
    chance = rng.random()
    if chance < 0.05:
        part.arm()
    elif chance > 0.99:
        part.fault()
    age = rng.choice((0.0, 0.0, 0.0, 0.03))
    sent = part.step(vector(rng), elapsed=PERIOD, age=age, allowed=rng.random() < 0.9)
    return sent, part.phase, part.heat, part.wanted


def step_passivity(part: Passivity, rng: random.Random) -> Any:
    chance = rng.random()
    elapsed = 8.0 * PERIOD if chance < 0.05 else 0.1 * PERIOD if chance < 0.1 else PERIOD
    part.observe(*vector(rng, 3e-5), elapsed, known=chance < 0.8)
    sent = part.bound(part.control(vector(rng), vector(rng, 0.1)))
    part.send(sent)
    return sent, part.energy


def step_motion(part: Motion, rng: random.Random) -> Any:
    if rng.random() < 0.1:
        part.set_gain(rng.uniform(10.0, 300.0))
    return part.step(*vector(rng, 1e-3), rng.random() < 0.8), part.commanded


def step_model(part: LocalModel, rng: random.Random) -> Any:
    if rng.random() < 0.3:
        bodies, beat = rng.sample(range(9), 3), rng.randrange(10**6)
        spheres = tuple(SphereFrame(vector(rng, 0.3), body) for body in bodies)
        state = SceneFrame(beat, rng.random(), spheres, (TrapFrame(0, vector(rng, 0.1), 20.0),))
        part.refresh(state, {0: (0.0, 0.0, 0.0)})
    return part.force(*vector(rng, 0.1))


def step_node(part: PaperForce, rng: random.Random) -> Any:
    speak = part.trap_message if rng.random() < 0.5 else part.robot_message
    return speak(vector(rng, 0.05), rng.random())


def step_paper(part: PaperRenderer, rng: random.Random) -> Any:
    if rng.random() < 0.1:
        part.set_gain(rng.random())
    return part.published(scene(rng, 1), rng.random())


def slow_motion(absolute: bool) -> Motion:
    low_pass = LowPass(alpha=0.1, rate=1000.0)
    return Motion(hand_config(absolute=absolute, motion_filter=low_pass, trap_speed=50.0))


def model(prediction: bool, smoothing: float) -> LocalModel:
    laws = {0: (IsotropicLaw(RADIAL), SplitLaw(RADIAL, AXIAL))}
    return LocalModel(laws, (0, 1, 0), prediction=prediction, smoothing=smoothing)


def paper() -> PaperRenderer:
    config: HandConfig = hand_config(**CONFIGS["paper"])
    return PaperRenderer(config, LocalModel({0: (IsotropicLaw(RADIAL),)}))


PARTS: dict[str, tuple[Callable[[], Any], Callable[[Any, random.Random], Any]]] = {
    "safety": (lambda: Safety(SafetyConfig(), 1000.0), step_safety),
    "passivity": (lambda: Passivity(PassivityConfig(), PERIOD), step_passivity),
    "filter": (lambda: VectorFilter(0.1), lambda part, rng: part.step(*vector(rng))),
    "velocity": (lambda: VelocityEstimate(PERIOD, 1e-4), lambda part, rng: part.step(*vector(rng, 1e-4))),
    "coupling": (
        lambda: VirtualCoupling(CouplingConfig(), 1000.0),
        lambda part, rng: part.step(*vector(rng, 1e-3), vector(rng)),
    ),
    "motion": (lambda: slow_motion(False), step_motion),
    "motion, absolute": (lambda: slow_motion(True), step_motion),
    "model": (lambda: model(False, 1.0), step_model),
    "model that predicts": (lambda: model(True, 0.2), step_model),
    "paper's node": (lambda: PaperForce(distance_damping=0.1), step_node),
    "paper": (paper, step_paper),
}
"""Part → how to make one, and how to step it."""

INNER = {Motion: ("filter",), PaperForce: ("filter",), PaperRenderer: ("node",)}
"""Parts within parts, whose states the chain keeps beside them."""

MADE_ANEW = {PaperForce: {"pull"}, LocalModel: {"traps"}}
"""Attributes that the next message, or the `refresh` of a restored chain, sets before they are read."""


def restored(make: Callable[[], Any], part: Any) -> Any:
    """A fresh part that goes on from another's state, parts within parts included."""
    fresh = make()
    pairs = [(fresh, part)]
    for into, of in pairs:
        pairs += [(getattr(into, name), getattr(of, name)) for name in INNER.get(type(of), ())]
        into.restore(through_json(of.state()))
    return fresh


def attributes(part: Any) -> dict[str, Any]:
    """All attributes of a part, those of parts within it in their place."""
    slots = {name for kind in type(part).__mro__ for name in getattr(kind, "__slots__", ())}
    names = (slots | set(getattr(part, "__dict__", ()))) - MADE_ANEW.get(type(part), set())
    found = {name: getattr(part, name) for name in names}
    nested = {n for n, v in found.items() if type(v).__module__.startswith("otwarp") and not is_dataclass(v)}
    assert nested == {n for n in INNER.get(type(part), ()) if found[n] is not None}, "a part that has no state"
    return found | {name: attributes(found[name]) for name in nested}


def lists(value: Any) -> Any:
    """Tuples as lists, to any depth."""
    return [lists(item) for item in value] if isinstance(value, list | tuple) else value


@pytest.mark.parametrize("name", PARTS)
def test_a_part_goes_on_bit_for_bit_from_its_state(name):
    make, step = PARTS[name]
    part, rng = make(), random.Random(1)
    for _ in range(60):
        step(part, rng)
    copy, again = restored(make, part), random.Random()
    if isinstance(part, LocalModel):
        copy.traps = part.traps  # a chain refreshes its model before it restores it
    again.setstate(rng.getstate())
    assert [step(part, rng) for _ in range(200)] == [step(copy, again) for _ in range(200)]


@pytest.mark.parametrize("name", PARTS)
def test_a_state_forgets_no_attribute(name):
    """Fails for an attribute that steps change and `state` lacks: a replay from mid-session would differ."""
    make, step = PARTS[name]
    part, rng = make(), random.Random(2)
    changed: set[str] = set()
    for _ in range(300):
        step(part, rng)
        old, new = attributes(restored(make, part)), attributes(part)
        for key, value in new.items():
            assert lists(old[key]) == lists(value) if not isinstance(value, dict) else old[key] == value, key
        changed |= {key for key, value in attributes(make()).items() if lists(value) != lists(new[key])}
    assert changed, "stepping it must change something, or this test means nothing"


@pytest.mark.parametrize("name", CONFIGS)
def test_every_part_of_a_chain_is_in_its_state(name):
    """Fails for a part or a number that is added to a chain and forgotten in `state`."""
    constant = {"config", "model", "_period", "_limited", "_moves", "_damping"}
    parts = {"safety", "passivity", "motion", "_velocity", "_coupling", "_filter", "_paper"}
    config, rng = hand_config(**CONFIGS[name]), random.Random(3)
    chain, hand = make_chain(config), random_motion(rng, 0.02)
    assert parts | constant < set(vars(chain))
    assert {type(v) for v in vars(chain).values() if type(v).__module__.startswith("otwarp.haptics.chain")} <= {
        Safety, Passivity, Motion, VelocityEstimate, VirtualCoupling, VectorFilter, PaperRenderer,
    }  # fmt: skip
    chain.arm()
    for n in range(200):
        state = scene(rng, 1 + n // 8)
        chain.step(DeviceSample(n * PERIOD, hand(n * PERIOD)), state)
    copy = make_chain(config)
    copy.restore(through_json(chain.state(state)))
    for key in set(vars(chain)) - parts - {"model"}:
        assert lists(vars(copy)[key]) == lists(vars(chain)[key]), key
    in_chain = {id(part) for part in chain.parts().values() if part is not None}
    assert {id(vars(chain)[key]) for key in parts if vars(chain)[key] is not None} <= in_chain


@pytest.mark.parametrize("name", CONFIGS)
@pytest.mark.parametrize("at", [0, 1, 37, 400, 640, 700])
def test_a_copy_goes_on_bit_for_bit_from_any_moment(name, at):
    """Armed and disarmed, gains that change, clutch and dead-man, a stall from 600 to 760 ms, time that begins anew."""
    config, rng = hand_config(**CONFIGS[name]), random.Random(at)
    chain, copy = make_chain(config), None
    hand = random_motion(rng, 0.02)
    state = scene(rng, 1)
    felt = 0.0
    for n in range(1000):
        if n == at:
            copy = make_chain(config)
            was = through_json(chain.state(state))
            copy.restore(was)
            assert through_json(copy.state(state)) == was
        if n % 8 == 0 and not 600 <= n < 760:
            state = scene(rng, 2 + n // 8)
        chains = [c for c in (chain, copy) if c is not None]
        action = rng.random()
        gain = rng.uniform(10.0, 300.0)
        for c in chains:
            if n in (3, 300, 770):
                c.arm()
            elif action < 0.003:
                c.disarm()
            elif action > 0.98:
                c.set_gains(gain, gain / 1000.0)
        sample = DeviceSample(n * PERIOD, hand(n * PERIOD), 1 if n % 90 < 80 else 3, n % 7 != 0)
        found = [(c.step(sample, state), c.asked, c.complaint) for c in chains]
        assert found[0] == found[-1]
        felt = max(felt, *map(abs, found[0][0].force))
    assert copy is not None
    assert felt > 0.0


@pytest.mark.parametrize("name", CONFIGS)
def test_a_state_that_an_earlier_version_recorded_is_read_and_kept(name):
    """Its layout is on users' disks; the states are those of 9a89201, from mid-session, with the names of that version.

    Two parts have grown since.
    """
    earlier = json.loads(Path(__file__).with_name("earlier_states.json").read_text())[name]
    chain = make_chain(hand_config(**CONFIGS[name]))
    chain.restore(earlier)
    written = through_json(chain.state(scene_from_list(earlier["scene"])))
    for part, kept in (("passivity", 2), ("velocity", 3)):
        written[part] = written[part][:kept]
    assert set(chain.parts()) - {n for n, part in chain.parts().items() if part is None} <= set(written)
    assert "" in earlier and not [part for part in written if "_" in part or not part]
    assert written == {OLD_NAMES.get(part, part): value for part, value in earlier.items()}


def test_a_state_of_another_configuration_is_refused():
    full, plain = (make_chain(hand_config(**CONFIGS[name])) for name in ("full", "plain"))
    state = SceneFrame(0, 0.0, (), ())
    for chain, other in ((full, plain), (plain, full)):
        with pytest.raises(InputError, match="does not fit its configuration"):
            chain.restore(through_json(other.state(state)))
    for bad in ({}, {"": 3}, [], {"anchors": 5}):
        with pytest.raises(InputError, match="does not fit"):
            Chain.restore(plain, bad)
