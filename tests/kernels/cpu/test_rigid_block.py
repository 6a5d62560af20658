"""Mobility and noise of a rigid body in vector registers against NumPy."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.bodies.rotational_noise import PART
from otwarp.kernels.core.types import vec6
from otwarp.kernels.cpu.rigid_block import KEPT, keep, kept_mobility_product, kick_at, make_kicks
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.samples import evaluate, on_device, quaternions
from tests.reference.rotations import matrix

PART_OF_TURN = 0.5**1.5
"""Half of 1/√2, see `rotational_noise`."""

ROUNDING = 2e-6
"""float32 sums of some dozen products of order 1."""


@pytest.fixture(autouse=True)
def cpu(device):
    if not wp.get_device(device).is_cpu:
        pytest.skip("vectors of bodies are for CPUs")


@wp.kernel(enable_backward=False)
def probe(
    buffer: wp.array(dtype=float),
    block: wp.array(dtype=vec6),
    skew: wp.mat33,
    trapped: wp.array(dtype=wp.vec4),
    deviates: wp.array(dtype=float),
    turn: wp.array(dtype=wp.quat),
    load: wp.array(dtype=vec6),
    move: wp.array(dtype=vec6),
    noise: wp.array(dtype=vec6),
):
    i = wp.tid()
    at = keep(
        buffer, i * wp.static(KEPT), block[0], block[1], block[2], block[3], skew, block[4], wp.mat44(0.0),
        wp.vec4(0.0), trapped, 0, 1,
    )  # fmt: skip
    rotation = wp.quat_to_matrix(turn[i])
    move[i] = kept_mobility_product(at, rotation, load[i])
    if i == 0:
        make_kicks(deviates, 0, at, PART)
    noise[i] = kick_at(wp.uint64(deviates.ptr), rotation, wp.int64(i))


def cayley(c: np.ndarray) -> np.ndarray:
    """The rotation (1 − [c]×)⁻¹ (1 + [c]×)."""
    cross = np.cross(np.eye(3), c)
    return np.linalg.solve(np.eye(3) - cross, np.eye(3) + cross)


def test_products_are_those_of_numpy(device):
    """M times a wrench and the factor times deviates, turned along, both turned with the body."""
    rng, n = np.random.default_rng(0), 16
    root = np.tril(rng.normal(size=(6, 6)))
    mobility = root @ root.T
    coupling = 0.5 * (mobility[3:, :3] + mobility[3:, :3].T)
    mobility[3:, :3] = mobility[:3, 3:] = coupling  # about the centre of diffusion it is symmetric

    def entries(block: np.ndarray) -> np.ndarray:
        return block[[0, 1, 2, 1, 2, 2], [0, 1, 2, 0, 0, 1]]

    blocks = [entries(m) for m in (mobility[:3, :3], coupling, mobility[3:, 3:], root[:3, :3], root[3:, 3:])]
    turn, load = quaternions(rng, n), rng.normal(size=(n, 6)).astype(np.float32)
    deviates = rng.normal(size=(6, 16)).astype(np.float32)
    given = [
        wp.zeros(n * KEPT + 16, dtype=float, device=device),
        device_array(blocks, vec6, device),
        wp.mat33(*root[3:, :3].ravel().tolist()),
        *on_device(device, ([[0.0, 0.0, 0.0, 1.0]], wp.vec4), (deviates.ravel(), float)),  # type: ignore[arg-type]
        *on_device(device, (turn, wp.quat), (load, vec6)),
    ]
    move, noise = evaluate(probe, n, given, [vec6, vec6], device)
    for i in range(n):
        whole = np.kron(np.eye(2), matrix(turn[i].astype(float)))
        np.testing.assert_allclose(move[i], whole @ mobility @ whole.T @ load[i], atol=10 * ROUNDING * mobility.max())
        kick = root @ deviates[:, i]
        kick[:3] = cayley(PART_OF_TURN * kick[3:]) @ kick[:3]
        np.testing.assert_allclose(noise[i], whole @ kick, atol=10 * ROUNDING)
