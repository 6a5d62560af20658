"""Order parameters of worlds and the interfaces they come to, against NumPy."""

import dataclasses

import numpy as np
import pytest

import otwarp as ot
from otwarp.errors import InputError
from otwarp.simulation.options import StepOptions
from otwarp.studies.rare.ensemble import FEW, GONE_BACK, IDLE, UP, Ensemble
from otwarp.units import BOLTZMANN
from tests.studies.scenes import bead_in_a_well, energy

WORLDS = 64
CENTRE = np.array([0.0, 0.0, 10.0])


def ensemble(scene, order, worlds=WORLDS):
    return Ensemble(
        scene, {}, worlds, order=order, seed=3, time_step=1e-3, every=2, options=StepOptions(), device="cpu"
    )


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return ot.Scene.load(bead_in_a_well(tmp_path_factory.mktemp("well")))


def test_distance_and_interfaces(scene):
    """Worlds stop at the look at which they are beyond an interface, and keep what they were; so do graphs of looks."""
    found = []
    for relative, unit in ((False, 1.0), (True, 0.4)):
        watched = ensemble(scene, ot.distance(relative=relative))
        everyone = np.arange(WORLDS)
        watched.start(everyone, everyone)
        watched.between(everyone, 0.02 / unit, 0.15 / unit)
        for _ in range(12):
            watched.look()
        done = watched.done.numpy().copy()
        far = np.linalg.norm(watched.sim.state.position.numpy()[:, 0] - CENTRE, axis=-1) / unit
        assert watched.orders(everyone) == pytest.approx(far, rel=1e-4)
        assert np.array_equal(done == UP, far >= 0.15 / unit) and np.array_equal(done == GONE_BACK, far < 0.02 / unit)
        assert np.all(watched.peak.numpy() >= watched.orders(everyone).astype(np.float32))
        assert {0, UP} <= set(done.tolist())
        found.append(watched.states(everyone))
    assert np.array_equal(found[0].clock, found[1].clock) and np.ptp(found[0].clock) > 0
    again = ensemble(scene, ot.distance())
    again.start(everyone, everyone)
    again.between(everyone, 0.02, 0.15)
    again.turns(12)
    graph = again.states(everyone)
    assert all(np.array_equal(graph.parts[name], rows) for name, rows in found[0].parts.items())


def test_energy_is_that_of_the_well(scene):
    """½ k r² P/k_BT of each world; a trap without a potential is refused."""
    watched = ensemble(scene, ot.energy("/World/trap"))
    everyone = np.arange(WORLDS)
    watched.start(everyone, everyone)
    watched.between(everyone, -np.inf, np.inf)
    watched.look()
    far2 = np.sum((watched.sim.state.position.numpy()[:, 0] - CENTRE) ** 2, axis=-1)
    assert watched.orders(everyone) == pytest.approx(0.25 * far2 / (BOLTZMANN * 298.15), rel=1e-3)
    pushed = dataclasses.replace(scene, traps=(dataclasses.replace(scene.traps[0], model="table"),))
    with pytest.raises(InputError, match="force of /World/trap, whose ot:trap:model is table, is not conservative"):
        ot.energy().values_in(pushed)


def test_the_last_worlds_go_on_elsewhere_with_the_same_bits(scene):
    """Paths of more worlds than are moved, against the same in ensembles so small that none is."""
    worlds = FEW + 40
    large, small = ensemble(scene, ot.distance(), worlds), ensemble(scene, ot.distance(), 40)
    everyone = np.arange(worlds)
    large.start(everyone, everyone)
    large.look()
    begun = large.states(everyone)
    numbers = (1000 + everyone).astype(np.uint32)
    large.done.fill_(IDLE)
    paths = large.run(everyone, begun, numbers, 0.03, 0.25)
    some = np.arange(7, worlds, 97)
    alone = small.run(np.arange(len(some)), begun[some], numbers[some], 0.03, 0.25)
    assert np.array_equal(alone.code, paths.code[some]) and np.array_equal(alone.looks, paths.looks[some])
    assert np.array_equal(alone.peak, paths.peak[some])
    position = "state.position"
    assert np.array_equal(alone.states.parts[position], paths.states[some].parts[position])


def test_nan(scene):
    """An order parameter that is no number is an error, not a path that goes on for good."""
    watched = ensemble(scene, energy(stiffness=np.nan))
    everyone = np.arange(WORLDS)
    watched.start(everyone, everyone)
    watched.between(everyone, -np.inf, np.inf)
    with pytest.raises(InputError, match="order energy is NaN in 64 of 64 worlds"):
        watched.look()
