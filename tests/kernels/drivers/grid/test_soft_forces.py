"""Forces of soft contacts at the start of a step against those of all pairs in float64."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kernels.drivers.grid.test_soft import ROUNDING, packed, soft_simulation
from tests.reference.contact import sphere_obstacle, sphere_pair
from tests.simulation.crowds import SOFT, places
from tests.simulation.setups import drag


def forces_between(where: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Net force (n, 3) and sum of normal forces (n,) in float64, floor included."""
    net, load = np.zeros((len(where), 3)), np.zeros(len(where))
    for i in range(len(where)):
        for j in range(len(where)):
            distance = float(np.linalg.norm(where[i] - where[j]))
            if j != i and distance < radii[i] + radii[j]:
                force = sphere_pair(SOFT, radii[i], SOFT, radii[j], distance)[0]
                net[i] += force * (where[i] - where[j]) / distance
                load[i] += abs(force)
        if where[i, 2] < radii[i]:
            force = sphere_obstacle(SOFT, radii[i], where[i, 2])[0]
            net[i, 2] += force
            load[i] += abs(force)
    return net, load


@pytest.mark.thorough
def test_one_step_moves_by_the_forces_of_all_pairs(device):
    """Cold: Δx = F·dt/6πηa, to rounding, in two worlds whose spheres are elsewhere."""
    scene = packed()
    radii = np.array([b.spheres[0].radius for b in scene.bodies])
    sim = soft_simulation(scene, worlds=2, device=device)
    start = places(sim) + np.array([[[0.0, 0.0, 0.0]], [[0.02, 0.01, -0.01]]])
    sim.set_state(position=start)
    start = places(sim)
    sim.step()
    moved = places(sim) - start
    for world in range(2):
        net, load = forces_between(start[world], radii)
        assert (load > 0.0).sum() > 30
        np.testing.assert_allclose(moved[world], net * sim.time_step / drag(radii[:, None]), rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(sim.readout.contact_load.numpy()[world], load, rtol=1e-3, atol=1e-4)
        np.testing.assert_allclose(sim.readout.contact_force.numpy()[world], net, rtol=1e-3, atol=1e-4)
