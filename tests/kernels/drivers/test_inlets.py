"""Where cells come in: at places drawn evenly, clear of obstacles, the same in all forms of a driver."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.simulation.setups import obstacle, robot
from tests.simulation.streams import COUNT, INLET_HIGH, INLET_LOW, row, simulate, stream


def test_places_are_uniform_and_independent(device):
    """Of 2,048 worlds in the driver without contact, twice: means, variances, tenths and correlations at 5σ."""
    sim = simulate(stream("solo"), device, worlds=2048)
    drawn = []
    for _ in range(2):
        sim.set_state(position=row(10.5))
        sim.step(1)
        inside = sim.state.position.numpy()[:, :COUNT].astype(float)
        drawn.append(((inside - INLET_LOW) / (INLET_HIGH - INLET_LOW)).reshape(-1, 3))
    assert np.all(sim.readout.entries.numpy()[:, :COUNT] == 2)
    n = len(drawn[0])
    for u in drawn:
        assert u.min() >= -1e-6 and u.max() <= 1.0 + 1e-6
        assert u.mean(axis=0) == pytest.approx(0.5, abs=5.0 / np.sqrt(12.0 * n))
        assert u.var(axis=0) == pytest.approx(1.0 / 12.0, abs=5.0 * np.sqrt((1.0 / 80.0 - 1.0 / 144.0) / n))
        for axis in u.T:
            share = np.histogram(axis, bins=10, range=(0.0, 1.0))[0]
            # χ² of 9 degrees of freedom: mean 9, variance 18
            assert ((share - n / 10.0) ** 2 / (n / 10.0)).sum() < 9.0 + 5.0 * np.sqrt(18.0)
    columns = np.corrcoef(np.hstack(drawn).T) - np.eye(6)
    assert np.abs(columns).max() < 5.0 / np.sqrt(n)
    # cells of a world, and a cell in neighbouring worlds
    cells = np.corrcoef(drawn[0][:, 0].reshape(-1, COUNT).T) - np.eye(COUNT)
    assert np.abs(cells).max() < 5.0 / np.sqrt(n / COUNT)


def test_nobody_comes_in_inside_an_obstacle(device):
    ball = obstacle("Ball", "sphere", (-8.0, -1.0, 0.0), (2.5, 0.0, 0.0))
    floor = obstacle("Floor", "plane", (0.0, 0.0, -3.2))
    sim = simulate(stream("world", first=-4.0, obstacles=(ball, floor)), device, worlds=40)
    sim.set_state(position=row(10.5))
    sim.step(1)
    place = sim.state.position.numpy()[sim.readout.entries.numpy() > 0].astype(float)
    assert len(place) > 100
    assert np.linalg.norm(place - (-8.0, -1.0, 0.0), axis=1).min() >= 3.5 - 1e-6
    assert place[:, 2].min() >= -2.2 - 1e-6


@pytest.mark.parametrize("how", ["float64", "one by one", "turning"])
def test_other_forms_of_the_driver_without_contact(how, device, monkeypatch):
    """In float64, without lanes, and with a body that turns: the same places for the same cells."""
    sim = simulate(stream("solo"), device, worlds=2)
    if how == "one by one":
        monkeypatch.setattr("otwarp.simulation.composition._takes_lanes", lambda f: False)
    scene = stream("solo")
    if how == "turning":
        scene = dataclasses.replace(scene, bodies=(*scene.bodies[:-1], robot("Robot", (0.0, 300.0, 0.0))))
    other = simulate(scene, device, worlds=2, precision="float64" if how == "float64" else "float32")
    for one in (sim, other):
        one.set_state(position=row(10.5))
        one.step(2)
        assert np.all(one.readout.entries.numpy()[:, :COUNT] == 1) and not one.readout.entries.numpy()[:, COUNT].any()
    cells = sim.state.position.numpy()[:, :COUNT]
    np.testing.assert_allclose(other.state.position.numpy()[:, :COUNT], cells, atol=2e-6)
