"""What cannot go on stops with the world, body and step named, and what cannot start is refused in one line."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.errors import InputError, SimulationError
from otwarp.scene import Scene, Settings
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import STIFFNESS, bead_scene, contact_scene, drag, neutral, robot


@pytest.fixture(params=["solo", "world", "grid"])
def scene(request, monkeypatch) -> Scene:
    """A scene for each driver; the first body is held by the first trap."""
    if request.param == "grid":
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    if request.param == "solo":
        return bead_scene()
    return contact_scene(neutral("Bead", (0.5, 0, 9.0)), neutral("B", (9.0, 0, 9.0)))


@pytest.mark.parametrize("poison", ["nan position", "huge power"])
def test_non_finite_states_stop_the_run(scene, poison, device):
    """A command spoils world 2 of 4 after 10 good steps; its body keeps the last good place, the others go on."""
    start = np.tile(np.array([t.position.at(0) for t in scene.traps]), (4, 1, 1))
    power = np.tile([20.0] + [0.0] * (len(scene.traps) - 1), (4, 1))
    sim = Simulation(scene, worlds=4, seed=1, device=device, parameters={"trap_position": start, "trap_power": power})
    sim.step(10)
    before = sim.state.position.numpy().copy()  # on the CPU `numpy` is a view
    if poison == "nan position":
        start[2, 0, 0] = np.nan
        sim.control.trap_position.assign(start.astype(np.float32))
    else:
        power[2, 0] = 3e38
        sim.control.trap_power.assign(power.astype(np.float32))
    with pytest.raises(SimulationError) as error:
        sim.step(40)
    assert (error.value.world, error.value.body, error.value.step) == (2, "/World/Bead", 10)
    assert error.value.time == pytest.approx(10 * sim.time_step)
    assert str(error.value).startswith("the state became non-finite")
    assert "world 2, body /World/Bead, step 10" in str(error.value)
    after = sim.state.position.numpy()
    assert np.all(np.isfinite(after))
    np.testing.assert_array_equal(after[2, 0], before[2, 0])
    assert np.all((after[[0, 1, 3], 0] != before[[0, 1, 3], 0]).any(axis=1))  # a height may rest on the floor
    with pytest.raises(SimulationError):  # it does not recover by itself
        sim.step()


@pytest.mark.parametrize("limit", [0, 24], ids=["grid", "world"])
def test_overlap_that_means_nothing_stops_the_run(limit, monkeypatch, device):
    """Two beads of which one starts more than half inside the other, and one that starts inside the floor."""
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", limit)
    for first, second in (((0, 0, 9.0), (0, 1.4, 9.0)), ((0, 0, 0.4), (9, 0, 9.0))):
        sim = Simulation(contact_scene(neutral("A", first), neutral("B", second)), device=device)
        before = sim.state.position.numpy().copy()
        with pytest.raises(SimulationError, match="overlap by more than half the smaller radius") as error:
            sim.step(5)
        assert error.value.step == 0
        assert error.value.body in ("/World/A", "/World/B")
        np.testing.assert_array_equal(sim.state.position.numpy()[0, 0], before[0, 0])


@pytest.mark.parametrize("driver", ["world", "grid"])
def test_too_many_contacts_stop_the_run(driver, monkeypatch, device):
    """A body of 70 small spheres lies flat on the floor: more contacts than either driver holds."""
    if driver == "grid":
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
        # a block of threads that has a world to itself holds as many for every sphere
        monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", 0)
    rows = [((0.5 * i, 0.5 * j, 0.0), 0.1) for i in range(10) for j in range(7)]
    carpet = robot("Carpet", (0.0, 0.0, 0.099), shape=rows, collides=True, trapped=False)
    # the same features as everywhere but for the rotation
    pair = contact_scene(neutral("A", (0, 0, 9.0)), neutral("B", (9.0, 0, 9.0)))
    scene = dataclasses.replace(pair, bodies=(pair.bodies[0], carpet))
    sim = Simulation(scene, device=device)
    assert sim.model.features.driver == driver
    with pytest.raises(SimulationError, match="more contacts at once than the solver holds") as error:
        sim.step(3)
    assert (error.value.body, error.value.step) == ("/World/Carpet", 0)


def test_a_fault_is_reported_for_the_earliest_step(device):
    """World 3 fails at its first step, world 1 later in the same call: world 3 is named."""
    pair = contact_scene(neutral("A", (0, 0, 9.0)), neutral("B", (9.0, 0, 9.0)))
    power = np.zeros((4, 2), dtype=np.float32)
    sim = Simulation(pair, worlds=4, device=device, parameters={"trap_power": power})
    position = sim.state.position.numpy().copy()
    position[3, 1] = [0.0, 1.2, 9.0]
    sim.state.position.assign(position)
    power[1, 0] = 2000.0  # a hundred times what this step can follow: the bead is thrown through the floor
    sim.control.trap_power.assign(power)
    with pytest.raises(SimulationError, match="world 3"):
        sim.step(10)
    steps = sim.readout.fault_step.numpy()
    codes = sim.readout.fault.numpy()
    assert codes[1].max() > 0
    assert steps[1].max() > 0
    assert steps[3].max() == 0
    np.testing.assert_array_equal(codes[[0, 2]], 0)


def test_an_unstable_time_step_names_the_largest_stable_one(device):
    """k·dt/γ = 2 is the limit of the explicit step, for the scene's own step and for the argument."""
    largest = 2 * drag(1.0) / STIFFNESS
    for build in (
        lambda dt: Simulation(bead_scene(), device=device, time_step=dt, allow_large_step=True),
        lambda dt: Simulation(bead_scene(time_step=dt), device=device, allow_large_step=True),
    ):
        with pytest.raises(InputError) as error:
            build(1.01 * largest)
        text = str(error.value)
        assert f"below {largest:.4g} s" in text
        assert "/World/Bead" in text
        assert "\n" not in text
        build(0.99 * largest)


def test_a_sweep_of_powers_tightens_the_step(device):
    """The strongest world decides: ten times the power, a tenth of the chosen step, and of the largest stable one."""
    base = Simulation(bead_scene(), worlds=2, device=device)
    swept = Simulation(bead_scene(), worlds=2, device=device, parameters={"trap_power": np.array([[20.0], [200.0]])})
    assert swept.time_step == pytest.approx(0.1 * base.time_step, rel=1e-3)  # both runs end with a whole step
    assert swept.model.scales.largest_stable == pytest.approx(0.1 * base.model.scales.largest_stable)
    # Heun's displacements over one step are the first to err by what the promised 1 % allows
    assert base.model.scales.errors["displacement"] == pytest.approx(-0.007, rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"worlds": 0}, "worlds is 0; allowed: 1 or more"),
        ({"worlds": -3}, "worlds is -3; allowed: 1 or more"),
        ({"seed": -1}, "seed is -1; allowed: 0 to 4294967295"),
        ({"seed": 2**32}, "seed is 4294967296; allowed: 0 to 4294967295"),
        ({"threads": 0}, "threads is 0; allowed: 1 or more"),
        ({"device": "cuda:99"}, "device is 'cuda:99'; allowed: cpu"),
        ({"device": "abacus"}, "device is 'abacus'; allowed: cpu"),
        ({"time_step": 0.0}, "time step is 0 s; allowed: above 0"),
        ({"time_step": float("nan")}, "time step is nan s; allowed: above 0"),
        ({"parameters": {"trap_power": np.nan}}, "parameter trap_power has the value nan; allowed: in [0, 10000] mW"),
    ],
    ids=str,
)
def test_arguments_out_of_range(arguments, message, device):
    with pytest.raises(InputError) as error:
        Simulation(bead_scene(), **({"device": device} | arguments))
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_running_for_a_bad_time(device):
    sim = Simulation(bead_scene(), device=device)
    for duration in (-1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match=r"duration is .* allowed: a finite time, 0 or more"):
            sim.run(duration)
    with pytest.raises(InputError, match="steps is -1; allowed: 0 or more"):
        sim.step(-1)
    sim.run(0.0)
    assert sim.state.step == 0


def test_run_takes_the_nearest_number_of_steps(device):
    sim = Simulation(bead_scene(time_step=1e-4), device=device)
    seen: list[float] = []
    sim.run(0.6001, progress=seen.append)
    assert sim.state.step == 6001
    assert seen == pytest.approx([0.5, 0.6001])
    sim.run(1e-5)
    assert sim.state.step == 6001


def test_a_scene_without_bodies_is_refused(device):
    with pytest.raises(InputError, match="/World has no body; allowed: at least one"):
        Simulation(Scene(settings=Settings()), device=device)
