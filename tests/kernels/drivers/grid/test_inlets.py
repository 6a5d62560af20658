"""Who comes in sees who is there and who came before, and waits; in the grid driver as in that of few bodies."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from tests.simulation.streams import COUNT, SETTINGS, row, simulate, stream


def apart(places: np.ndarray) -> float:
    """Least distance of two of the points (n, 3)."""
    return min(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(places, 2))


def test_nobody_comes_in_where_somebody_is(device, monkeypatch):
    """Of eight that leave at once not all find room in so small an inlet; who waits comes in when there is some.

    All drivers choose the same places.
    """
    small = dataclasses.replace(SETTINGS, inlet_low=(-9.0, -1.2, -1.2), inlet_high=(-8.0, 1.2, 1.2))
    found = {}
    for driver in ("world", "soft", "stiff"):
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 24 if driver == "world" else 0)
        sim = simulate(stream(driver, settings=small), device, worlds=4)
        sim.set_state(position=row(10.5))
        sim.step(1)
        place, inside = sim.state.position.numpy().astype(float), sim.readout.entries.numpy() > 0
        assert np.all(inside.sum(axis=1) >= 1) and np.all(inside.sum(axis=1) <= 4), "the inlet holds four at most"
        for world in range(4):
            here = place[world, inside[world]]
            assert len(here) == 1 or apart(here) >= 2.0 - 1e-6
            assert np.all(here >= np.array(small.inlet_low) - 1e-6)
            assert np.all(here <= np.array(small.inlet_high) + 1e-6)
            assert np.all(place[world, :COUNT][~inside[world, :COUNT], 0] > 10.0)
        found[driver] = place[inside]
        sim.step(150)
        assert np.all(sim.readout.entries.numpy()[:, :COUNT] == 1)
        assert np.all(sim.readout.contact_load.numpy() < 1e-3), "somebody came in pressed on another"
    assert np.array_equal(found["world"], found["stiff"]) and np.array_equal(found["world"], found["soft"])
