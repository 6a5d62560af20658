"""The force law of contacts on the device against its twin, and the step of a lone contact."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.contact import overlap_alone, pair_law, pair_reach
from otwarp.kernels.core.types import ContactData
from otwarp.scene import Material
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.samples import evaluate, on_device
from tests.reference import contact as twin
from tests.reference.contact import adhesion_of, sphere_obstacle, sphere_pair

FORCE = 2e-5
"""float32 force relative to the parts it is made of: the overlap δ, a difference of lengths of order 1, to the 3/2."""


MATERIALS = (
    Material(youngs_modulus=1e3, poisson_ratio=0.45, adhesion=0.5, adhesion_range=0.05),
    Material(youngs_modulus=1e6, poisson_ratio=0.4),
    Material(youngs_modulus=5e3, poisson_ratio=0.3, adhesion=0.1, adhesion_range=0.2),
    Material(youngs_modulus=2e3, poisson_ratio=0.3, adhesion=0.5, adhesion_range=0.02),
)


@wp.kernel(enable_backward=False)
def probe_law(
    contact: ContactData,
    a: wp.array(dtype=int),
    b: wp.array(dtype=int),
    radius: wp.array(dtype=float),
    overlap: wp.array(dtype=float),
    out: wp.array(dtype=wp.vec4),
):
    i = wp.tid()
    law = pair_law(contact, a[i], b[i], radius[i], overlap[i])
    out[i] = wp.vec4(law.force, law.stiffness, law.floor, pair_reach(contact, a[i], b[i]))


def surfaces(device: str) -> ContactData:
    data = ContactData()
    data.compliance = device_array([(1 - m.poisson_ratio**2) / m.youngs_modulus for m in MATERIALS], wp.float32, device)
    data.adhesion = device_array([m.adhesion for m in MATERIALS], wp.float32, device)
    data.adhesion_range = device_array([m.adhesion_range for m in MATERIALS], wp.float32, device)
    return data


def test_force_law_is_that_of_the_twin(device):
    """Hertz repulsion, adhesion with and without contact, out of range; spheres and obstacles; every pair."""
    rng, n = np.random.default_rng(0), 3000
    a, b = rng.integers(0, 4, n), rng.integers(-1, 4, n)
    radius = rng.uniform(0.3, 3.0, n).astype(np.float32)
    overlap = rng.uniform(-0.25, 0.3, n).astype(np.float32)
    overlap[:50] = 0.0
    given = on_device(device, (a, int), (b, int), (radius, float), (overlap, float))
    (got,) = evaluate(probe_law, n, [surfaces(device), *given], [wp.vec4], device)
    for i in range(n):
        r, d, ma = float(radius[i]), float(overlap[i]), MATERIALS[a[i]]
        if b[i] < 0:
            force, stiffness = sphere_obstacle(ma, r, r - d)
            work, reach = ma.adhesion, ma.adhesion_range
        else:
            mb = MATERIALS[b[i]]
            # two spheres of twice the radius have the effective radius r
            force, stiffness = sphere_pair(ma, 2 * r, mb, 2 * r, 4 * r - d)
            work, reach = adhesion_of(ma, mb)
        pull = 2 * np.pi * r * work
        assert got[i, 0] == pytest.approx(force, abs=FORCE * (abs(force) + pull + 1e-6) + FORCE * stiffness * 0.01)
        # at δ = 0 the stiffness is a root of rounding
        assert got[i, 1] == pytest.approx(stiffness, rel=1e-4, abs=1e-3 if d == 0 else 1e-9)
        assert got[i, 2] == pytest.approx(-pull, rel=1e-6)
        if work > 0.0:
            assert got[i, 3] >= np.float32(reach) * (1 - 1e-6)  # the search reaches at least as far as the law
        elif b[i] < 0 or MATERIALS[b[i]].adhesion == 0.0:
            assert got[i, 3] == 0.0


@wp.kernel(enable_backward=False)
def probe_alone(
    hardness: wp.array(dtype=float),
    give: wp.array(dtype=float),
    reach: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    out[i] = overlap_alone(hardness[i], give[i], reach[i])


def test_a_lone_contact_ends_where_backward_euler_takes_it(device):
    """Five of Newton's steps from above: to float32 rounding from the softest contact to the hardest."""
    rng, n = np.random.default_rng(4), 2000
    given = [(10.0 ** rng.uniform(*r, n)).astype(np.float32) for r in ((-2, 11), (-8, 1), (-7, 1))]
    (got,) = evaluate(probe_alone, n, on_device(device, *((v, float) for v in given)), [float], device)
    expected = [twin.overlap_alone(*map(float, row)) for row in zip(*given, strict=True)]
    np.testing.assert_allclose(got, expected, rtol=1e-5)
