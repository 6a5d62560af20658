"""The grid driver against the world driver."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulation.test_contact import forces, places, pressed


@pytest.mark.thorough
def test_drivers_agree_until_contact_and_nearly_after(device, monkeypatch):
    """World and grid driver: the same displacement to rounding before contact, the same rest after it."""
    fused = pressed(0.3, device, "world", apart=0.3, seed=4, integrator="eulerMaruyama")
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    grid = pressed(0.3, device, "grid", apart=0.3, seed=4, integrator="eulerMaruyama")
    for sim in (fused, grid):
        sim.step(1)
    np.testing.assert_allclose(places(fused), places(grid), atol=2e-6)
    for sim in (fused, grid):
        sim.step(3999)
    np.testing.assert_allclose(places(fused), places(grid), atol=2e-4)
    np.testing.assert_allclose(forces(fused)[0], forces(grid)[0], atol=2e-2)
