"""Many stiff contacts at once, by both drivers: a column, a row, a heap; and contacts that turn or have no normal."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.errors import SimulationError
from otwarp.scene import Body, Medium, Obstacle, Scene, Settings, Track, Trap
from otwarp.simulation.simulation import Simulation
from otwarp.units import STANDARD_GRAVITY
from tests.simulation.setups import VISCOSITY, contact_scene, drag, harmonic, line, neutral, obstacle, sphere_body

WEIGHT = (1190e-12 - Medium().density) * 4 / 3 * np.pi * STANDARD_GRAVITY
"""Of a bead of radius 1 µm under water [pN]."""

REST = {"world": 2e-3, "grid": 3e-3}
"""Place after settling [µm]: Hertz overlaps of up to 3e-4 add up; the grid driver's sweeps are not quite done."""

LOAD = {"world": 1e-2, "grid": 0.3}
"""Load in the column: overlaps of 1e-5 in float32 coordinates; unfinished sweeps show in forces first."""


@pytest.fixture(params=["world", "grid"])
def driver(request, monkeypatch) -> str:
    """Each test runs through both drivers; few bodies go to the grid driver when a world may hold none."""
    if request.param == "grid":
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    return request.param


def still(bodies: tuple[Body, ...], time_step: float | None, traps: tuple[Trap, ...] = (), *walls: Obstacle) -> Scene:
    """Bodies of the default material without noise."""
    return Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=bodies,
        traps=traps,
        obstacles=walls,
        settings=Settings(gravity=True, brownian=False, time_step=time_step),
    )


@pytest.mark.parametrize(("count", "time_step"), [(6, 1 / 60), (6, 1e-3)])
def test_a_stiff_column_stands(count, time_step, driver, device):
    """Stiffness × mobility × dt is 2·10⁴ at the longest step; every bead carries those above it."""
    beads = tuple(sphere_body(f"B{i}", (0, 0, 1.0 + 2 * i), collides=True) for i in range(count))
    sim = Simulation(still(beads, time_step, (), obstacle("Floor", "plane", (0, 0, 0))), device=device)
    assert sim.model.features.driver == driver
    sim.run(0.5)
    np.testing.assert_allclose(
        sim.state.position.numpy()[0, :, 2], 1.0 + 2 * np.arange(count), rtol=0, atol=REST[driver]
    )
    load = sim.readout.contact_load.numpy()[0]
    below = WEIGHT * (count - np.arange(count))
    np.testing.assert_allclose(load, below + np.append(below[1:], 0.0), rtol=LOAD[driver], atol=0.1 * WEIGHT)


@pytest.mark.parametrize(("count", "time_step"), [(8, 1e-4), (8, 1e-3)])
def test_a_stiff_row_is_pushed_from_behind(count, time_step, driver, device):
    """One trap drives the row at 20 µm/s: every contact carries the drag of the beads ahead of it."""
    speed, after = 20.0, 0.5
    beads = tuple(neutral(f"B{i}", (-2.0 * i, 0, 50)) for i in range(count))
    back = -2.0 * (count - 1)
    trap = harmonic("T", line((0.0, (back, 0, 50)), (10.0, (back + 10 * speed, 0, 50))), cutoff=1.0)
    sim = Simulation(still(beads, time_step, (trap,)), device=device, allow_large_step=True)
    assert sim.model.features.driver == driver
    sim.run(after)
    place = sim.state.position.numpy()[0].astype(float)
    total = count * drag(1.0) * speed
    expected = back + speed * after - total / 20.0 + 2.0 * np.arange(count)[::-1]
    np.testing.assert_allclose(place[:, 0], expected, rtol=0, atol=REST[driver])
    np.testing.assert_allclose(place[:, 1:], [[0, 50]] * count, rtol=0, atol=1e-5)
    ahead = drag(1.0) * speed * np.arange(count + 1.0)
    ahead[-1] = 0.0  # behind the last bead is only the trap
    load = sim.readout.contact_load.numpy()[0]
    np.testing.assert_allclose(load, ahead[:-1] + ahead[1:], rtol=2e-2)


@pytest.mark.parametrize("time_step", [1e-4, 1e-3, 4e-3])
def test_a_paddle_pushes_a_bead_without_sinking_in(time_step, driver, device):
    """A box of half width 1 µm turns 0.2 times a second; a bead 10 µm out on its face is pushed along.

    The overlap is that of the Hertz force of the drag, 1e-4 µm, whatever the step; the sideways slip is slow.
    """
    rate = 0.2 * 2 * np.pi
    times = np.linspace(0.0, 0.5, 51)
    turns = np.stack([0 * times, 0 * times, np.sin(rate * times / 2), np.cos(rate * times / 2)], axis=1)
    paddle = Obstacle(
        prim="/World/Paddle",
        shape="box",
        position=Track(times=times, values=np.tile((0.0, 0.0, 50.0), (len(times), 1))),
        orientation=Track(times=times, values=turns),
        size=(20.0, 1.0, 5.0),
    )
    beads = (neutral("A", (10.0, 2.0, 50.0)), neutral("B", (0.0, 60.0, 50.0)))
    sim = Simulation(still(beads, time_step, (), paddle), device=device)
    assert sim.model.features.driver == driver
    sim.run(0.4)
    x, y, _ = sim.state.position.numpy()[0, 0].astype(float)
    angle = rate * sim.time
    overlap = 2.0 - (np.cos(angle) * y - np.sin(angle) * x)
    assert abs(overlap) < 1e-3
    assert sim.readout.contact_load.numpy()[0, 0] == pytest.approx(drag(1.0) * rate * np.hypot(x, y), rel=0.1)


def test_spheres_on_one_centre_stop_the_run(driver, device):
    """No normal is no excuse: it is the deepest overlap there is."""
    sim = Simulation(contact_scene(neutral("A", (0, 0, 9.0)), neutral("B", (9.0, 0, 9.0))), device=device)
    assert sim.model.features.driver == driver
    position = sim.state.position.numpy().copy()
    position[0, 1] = position[0, 0]
    sim.state.position.assign(position)
    with pytest.raises(SimulationError, match="overlap by more than half the smaller radius"):
        sim.step(3)
