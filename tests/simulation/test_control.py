"""Commands: `Control.set` reaches every driver at once, per world, and refuses what the time step cannot carry."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import warp as wp

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import STIFFNESS, bead_scene, contact_scene, drag, harmonic, line, neutral
from tests.simulation.test_checkpoint import authored


def pair_scene() -> Scene:
    """Two beads in two traps that each reach their own, far from each other and from everything else."""
    traps = (harmonic("TA", (0.0, 0.0, 9.0), cutoff=2.0), harmonic("TB", (9.0, 0.0, 9.0), cutoff=2.0))
    return contact_scene(neutral("A", (0.0, 0.0, 9.0)), neutral("B", (9.0, 0.0, 9.0)), traps=traps)


@pytest.mark.parametrize(
    "driver",
    [pytest.param("solo", marks=pytest.mark.thorough), "world", pytest.param("grid", marks=pytest.mark.thorough)],
)
def test_every_driver_sees_new_commands(driver, monkeypatch, device):
    """One row, then one row per world, then in place again: beads follow each within some relaxation times."""
    if driver == "grid":
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    scene = dataclasses.replace(bead_scene(time_step=2e-4), medium=pair_scene().medium)
    scene = scene if driver == "solo" else pair_scene()
    sim = Simulation(scene, worlds=3, device=device)
    assert sim.model.features.driver == driver
    sim.step(5)
    start = np.array([t.position.at(0.0) for t in scene.traps])
    steps = 60  # ten relaxation times
    for shift in (np.array([[0.2]]), np.array([[0.0], [0.1], [0.3]]), np.array([[0.3], [0.2], [0.1]])):
        goal = start + shift[..., None] * [1.0, 0.0, 0.0]
        sim.control.set(trap_position=goal)
        sim.step(steps)
        expected = np.broadcast_to(goal, (3, *start.shape))
        np.testing.assert_allclose(sim.state.position.numpy(), expected, atol=2e-3)
    assert sim.control.trap_position.shape == (3, len(scene.traps))
    assert sim.control.trap_power.shape == (1, len(scene.traps))


def test_readout_is_that_of_the_new_command(device):
    sim = Simulation(bead_scene(), worlds=2, device=device)
    before = sim.readout.trap_distance.numpy().copy()
    sim.control.set(trap_position=[[[0.5, 0.0, 0.0]], [[0.0, 0.7, 0.0]]], trap_power=10.0)
    np.testing.assert_array_equal(before, 0.0)
    np.testing.assert_allclose(sim.readout.trap_distance.numpy()[:, 0], [0.5, 0.7], rtol=1e-6)
    np.testing.assert_array_equal(sim.readout.trap_power.numpy(), 10.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"trap_position": [0.0, np.nan, 0.0]}, "parameter trap_position has the value nan; allowed: finite"),
        ({"trap_position": [0.0, 0.0]}, r"parameter trap_position has shape \(2,\); allowed: "),
        ({"trap_power": -1.0}, r"parameter trap_power has the value -1; allowed: in \[0, 10000\]"),
        ({"trap_power": np.ones((5, 1))}, r"has shape \(5, 1\); allowed: .*worlds = 2, traps = 1"),
        ({"follow": 4}, "control follow has the value 4; allowed: 0, 1, 2 or 3"),
        ({"follow": [1, 1]}, r"control follow has shape \(2,\); allowed: scalar or \(traps,\), traps = 1"),
    ],
    ids=str,
)
def test_bad_commands_write_nothing(arguments, message, device):
    sim = Simulation(bead_scene(), worlds=2, device=device)
    with pytest.raises(InputError, match=message) as error:
        sim.control.set(**({"trap_power": 1.0, "trap_position": (1.0, 1.0, 1.0)} | arguments))
    assert "\n" not in str(error.value)
    np.testing.assert_array_equal(sim.control.trap_power.numpy(), 20.0)
    np.testing.assert_array_equal(sim.control.trap_position.numpy(), 0.0)


def test_powers_beyond_the_time_step(device):
    """A trap authored dark leaves the step at a frame: 20 mW would be unstable, and the largest stable power is named.

    The step is stable up to k·dt/γ = 2; well below that its variance error is announced.
    """
    dark = dataclasses.replace(bead_scene(), traps=(harmonic("Trap", power=0.0),))
    sim = Simulation(dark, device=device)
    largest = 2.0 * drag(1.0) / sim.time_step / STIFFNESS * 20.0
    with pytest.raises(InputError, match=f"trap /World/Trap: power 20 mW .* allowed: below {largest:.4g} mW"):
        sim.control.set(trap_power=20.0)
    with pytest.raises(InputError, match="is unstable"):
        sim.control.set(trap_power=1.001 * largest)
    np.testing.assert_array_equal(sim.control.trap_power.numpy(), 0.0)
    with pytest.warns(UserWarning, match="stationary variances of body /World/Bead 89 % too small"):
        sim.control.set(trap_power=0.9 * largest)
    with pytest.warns(UserWarning, match=r"misses the wanted accuracy of 1 %: .* body /World/Bead 3.8 % too small"):
        sim.control.set(trap_power=0.18 * largest)
    sim.step(200)
    sim.control.set(trap_power=0.05 * largest)  # no warning: the tests turn warnings into errors


def test_arrays_cannot_be_replaced(device):
    sim = Simulation(bead_scene(), device=device)
    other = wp.zeros((1, 1), dtype=wp.vec3, device=device)
    with pytest.raises(InputError, match=r"control\.trap_position cannot be replaced.*control\.set\(trap_position="):
        sim.control.trap_position = other
    with pytest.raises(InputError, match=r"state\.position cannot be replaced.*sim\.set_state"):
        sim.state.position = other
    with pytest.raises(InputError, match=r"control\.trap_pwoer does not exist; allowed: trap_position, trap_power"):
        sim.control.trap_pwoer = 3.0


@pytest.mark.thorough
def test_what_is_commanded_stops_following(device):
    """Per trap if `follow` says so; an authored position given as a parameter stops all, and can be undone."""
    moves = [line((-1.0, (x - 1.0, 0, 0)), (1.0, (x + 1.0, 0, 0))) for x in (0.0, 9.0)]
    bodies = bead_scene().bodies
    scene = dataclasses.replace(
        bead_scene(), bodies=bodies, traps=tuple(harmonic(f"T{i}", m) for i, m in enumerate(moves))
    )
    sim = Simulation(scene, device=device)
    # time samples before the start: the value at the start counts
    np.testing.assert_allclose(sim.control.trap_position.numpy()[0, :, 0], [0.0, 9.0])
    assert sim.control.follow.numpy().tolist() == [1, 1]
    sim.control.set(trap_power=10.0)
    assert sim.control.follow.numpy().tolist() == [1, 1]
    sim.control.set(trap_position=[[0.0, 2.0, 0.0], [9.0, 2.0, 0.0]], follow=[0, 1])
    np.testing.assert_allclose(sim.readout.trap_position.numpy()[0], [[0.0, 2.0, 0.0], [9.0, 0.0, 0.0]], atol=1e-6)
    sim.control.set(trap_position=[[0.0, 2.0, 0.0], [9.0, 2.0, 0.0]])
    assert sim.control.follow.numpy().tolist() == [0, 0]
    given = Simulation(scene, device=device, parameters={"trap_position": [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]]})
    assert given.control.follow.numpy().tolist() == [0, 0]
    given.control.set(follow=True)
    assert given.control.follow.numpy().tolist() == [3, 3]


def test_a_limited_trap_starts_where_it_is_at_the_start(device):
    """With samples from −1 s on, the focus of a trap with a speed limit is not that of its first sample."""
    path = line((-1.0, (-5.0, 0, 0)), (1.0, (5.0, 0, 0)))
    scene = dataclasses.replace(bead_scene(), traps=(harmonic("T", path, speed_limit=100.0),))
    sim = Simulation(scene, device=device)
    np.testing.assert_allclose(sim.state.trap_position.numpy(), 0.0, atol=1e-6)


def test_commands_per_world_survive_a_checkpoint(tmp_path, device):
    scene = authored(bead_scene(), tmp_path / "bead.usda")
    sim = Simulation(scene, worlds=2, device=device)
    sim.control.set(trap_power=[[5.0], [15.0]])
    again = Simulation.restore(sim.save(tmp_path / "bead.npz"), device=device)
    np.testing.assert_array_equal(again.control.trap_power.numpy(), [[5.0], [15.0]])
    for each in (sim, again):
        each.step(50)
    np.testing.assert_array_equal(sim.state.position.numpy(), again.state.position.numpy())


@pytest.mark.thorough
def test_bodies_put_elsewhere_are_found_by_the_grid(monkeypatch, device):
    """Two beads set down overlapping by 0.1 µm push each other in the very next step, and from both drivers alike."""
    loads = []
    for limit in (24, 0):
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", limit)
        off = tuple(harmonic(f"T{i}", (0, 0, 0), power=0.0) for i in "AB")
        sim = Simulation(dataclasses.replace(pair_scene(), traps=off), worlds=2, device=device)
        sim.step(3)
        position = sim.state.position.numpy().copy()
        position[1] = [[0.0, 0.0, 9.0], [1.9, 0.0, 9.0]]
        sim.set_state(position=position)
        sim.step()
        loads.append(sim.readout.contact_load.numpy().copy())
    assert np.all(loads[0][0] == 0.0)
    assert np.all(loads[0][1] > 0.0)
    # sweeps settle a gap to 1e-6 µm, and the contact is a spring of 1.6e4 pN/µm
    np.testing.assert_allclose(loads[0], loads[1], atol=0.016)


def test_bad_states_are_refused(device):
    sim = Simulation(bead_scene(), worlds=2, device=device)
    for given, message in (
        ({"position": np.zeros((3, 1, 3))}, r"state position has shape \(3, 1, 3\); allowed: \(1, 3\) or \(2, 1, 3\)"),
        ({"position": [[0.0, 0.0, np.inf]]}, "state position has the value inf; allowed: finite numbers"),
        ({"orientation": [[0.0, 0.0, 0.0, 1.0]]}, "no body rotates"),
    ):
        with pytest.raises(InputError, match=message):
            sim.set_state(**given)
