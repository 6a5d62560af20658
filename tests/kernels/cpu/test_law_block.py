"""Laws of contacts in vector registers against the same laws one by one."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.implicit_law import DEPTH_ROUNDS, DEPTH_TOLERANCE, Line, line_of
from otwarp.kernels.cpu.law_block import sum_lines_term, vec9
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.contact.test_implicit_law import samples
from tests.kernels.samples import on_device

COUNT = 19
"""Contacts of a sum: two blocks of lanes, and three more."""

ROUNDING = 1e-5
"""float32 sums of some twenty loads, of arguments whose products are fused in one and not in the other."""

_sum_lines = sum_lines_term(DEPTH_ROUNDS, DEPTH_TOLERANCE)


@wp.kernel(enable_backward=False)
def probe_sums(
    face: wp.array(dtype=wp.vec4),
    law: wp.array(dtype=wp.vec4),
    path: wp.array(dtype=wp.vec2),
    depth: wp.array2d(dtype=float),
    way: wp.vec3,
    first: bool,
    found: wp.array2d(dtype=vec9),
):
    t = wp.tid()
    begin = COUNT * t
    found[0, t] = _sum_lines(face, law, path, depth[0], begin, begin + COUNT, way, first)
    total = vec9()
    for i in range(begin, begin + COUNT):
        n = wp.vec3(face[i][0], face[i][1], face[i][2])
        c = Contact()
        c.overlap = law[i][0]
        c.hardness = law[i][1]
        c.give = law[i][2]
        c.floor = law[i][3]
        c.wander = path[i][0]
        c.layer = path[i][1]
        line = Line()
        line = line_of(c, face[i][3] + wp.dot(n, way), depth[1, i], first)
        depth[1, i] = line.depth
        k = line.slope * n
        total += vec9(k[0] * n[0], k[0] * n[1], k[0] * n[2], k[1] * n[1], k[1] * n[2], k[2] * n[2], 0.0, 0.0, 0.0)
        total += vec9(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, line.load * n[0], line.load * n[1], line.load * n[2])
    found[1, t] = total


@pytest.mark.parametrize("first", [True, False], ids=["alone", "tangent"])
def test_sums_are_those_of_the_laws_one_by_one(first, device):
    """Paths and Hertz's law mixed in a block, gaps that carry nothing, and a block that is not full."""
    if not wp.get_device(device).is_cpu:
        pytest.skip("vectors of contacts are for CPUs")
    laws, give, opening = samples()
    n = COUNT * (len(laws) // COUNT)
    normal = np.random.default_rng(5).normal(size=(n, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    way = np.array([0.01, -0.02, 0.005])
    face = np.column_stack([normal, opening[:n] - normal @ way])
    law = np.column_stack([laws[:n, 0], laws[:n, 1], give[:n], np.full(n, -0.1)])
    start = np.tile(np.maximum(laws[:n, 0], 0.0), (2, 1))
    found = wp.zeros((2, n // COUNT), dtype=vec9, device=device)
    given = on_device(device, (face, wp.vec4), (law, wp.vec4), (laws[:n, 2:], wp.vec2))
    depths = device_array(start, wp.float32, device, ndim=2)
    wp.launch(probe_sums, n // COUNT, [*given, depths, wp.vec3(*way), first, found], device=device)
    lanes, alone = found.numpy()
    scale = np.abs(alone).reshape(-1, 3, 3).max(axis=(0, 2)).repeat(3)
    assert (np.abs(lanes - alone) < ROUNDING * scale).all()
    assert (np.abs(alone) > 0.1 * scale).mean() > 0.3
    depth = depths.numpy()
    assert np.abs(depth[0] - depth[1]).max() < ROUNDING * depth.max()
    assert (depth[1] > 0.0).mean() > 0.3 and (depth[1] == 0.0).mean() > 0.1
