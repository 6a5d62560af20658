"""What is kept of a number's course, against NumPy."""

import numpy as np
import pytest
import warp as wp

import otwarp as ot
from otwarp.kernels.core.precision import kernel_module
from otwarp.kernels.drivers.episodes import WorldFunction
from otwarp.kernels.drivers.observations import REDUCTIONS
from otwarp.simulation.simulation import Simulation
from tests.studies.scenes import bead_in_a_well


def height(now: ot.WorldNow, above: float) -> float:  # type: ignore[valid-type]
    """Height of the first body above a level [µm]."""
    return now.state.position[now.world, 0][2] - above


def test_reductions(tmp_path):
    """Last, largest, least, mean and integral of ten readings, and nothing more once a world has ended."""
    scene = ot.Scene.load(bead_in_a_well(tmp_path))
    sim = Simulation(scene, worlds=3, device="cpu", ends=[ot.timed_out(after=1.0)])
    count = len(REDUCTIONS)
    kernel = kernel_module("drivers.observations", "float32").observe_kernel(
        (WorldFunction(height, (float,)),) * count, REDUCTIONS
    )
    values = wp.array(np.full((1, count), 10.0, np.float32), dtype=wp.float32, device="cpu")
    kept, counts = wp.zeros((3, count), dtype=wp.float32, device="cpu"), wp.zeros(3, dtype=int, device="cpu")
    seen = []
    for _ in range(10):
        sim.step(4)
        views = [sim.model.data, sim.state.data(), sim.readout.data(), values, kept, counts, 4]
        wp.launch(kernel, dim=3, inputs=views, device="cpu")
        seen.append(sim.state.position.numpy()[:, 0, 2].copy() - 10.0)
    z = np.array(seen)
    right = np.stack([z[-1], z.max(axis=0), z.min(axis=0), z.mean(axis=0), 4 * sim.time_step * z.sum(axis=0)], axis=1)
    assert kept.numpy() == pytest.approx(right, rel=1e-4, abs=1e-6)
    assert counts.numpy().tolist() == [10, 10, 10]
    sim.episodes.done.fill_(1)
    sim.step(4)
    before = kept.numpy().copy()
    wp.launch(kernel, dim=3, inputs=views, device="cpu")
    assert np.array_equal(kept.numpy(), before)
