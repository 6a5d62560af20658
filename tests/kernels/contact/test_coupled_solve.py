"""Contacts of bodies that are coupled through the liquid."""

from __future__ import annotations

import numpy as np

from otwarp.scene import Medium, Scene
from otwarp.simulation.simulation import Simulation
from tests.reference import coupling as reference
from tests.simulation.setups import (
    VISCOSITY,
    harmonic,
    neutral,
)
from tests.simulation.test_coupling import ROUNDING, coupled, own_mobilities


def test_contact_forces_move_all_bodies(device):
    """Four beads, three of them pressed together: displacements are M (F + contact forces) dt with the whole M."""
    places = np.array([[0.0, 0, 0], [1.99, 0, 0], [1.0, 1.72, 0], [1.0, -2.2, 0.3]])
    bodies = tuple(neutral(f"B{i}", tuple(p)) for i, p in enumerate(places))
    goal = np.array([1.0, 0.4, 0.0])
    traps = (harmonic("Trap", tuple(goal), power=2.0, cutoff=2.1),)
    scene = Scene(medium=Medium(viscosity=VISCOSITY), bodies=bodies, traps=traps)
    scene = coupled(scene, brownian=False, time_step=1e-4, integrator="eulerMaruyama")
    sim = Simulation(scene, device=device)
    start = sim.state.position.numpy()[0].astype(float)
    reached = np.linalg.norm(start - goal, axis=1) < 2.1
    trap = np.where(reached[:, None], -2.0 * (start - goal), 0.0)
    sim.step()
    contact = sim.readout.contact_force.numpy()[0].astype(float)
    assert np.abs(contact[:3]).max(axis=1).min() > 0.3
    np.testing.assert_allclose(contact.sum(axis=0), 0.0, atol=1e-4)
    load = np.hstack([trap + contact, np.zeros((4, 3))])
    whole = reference.whole_mobility(start, [np.eye(3)] * 4, own_mobilities(scene))
    expected = reference.moves(whole, load, 1e-4 / VISCOSITY)[:, :3]
    moved = sim.state.position.numpy()[0] - start
    np.testing.assert_allclose(moved, expected, atol=ROUNDING)
    # the fourth touches nothing; of what moves it a good part is contact's
    by_contact = reference.moves(whole, np.hstack([contact, np.zeros((4, 3))]), 1e-4 / VISCOSITY)[3, :3]
    assert np.abs(by_contact).max() > 30.0 * ROUNDING
