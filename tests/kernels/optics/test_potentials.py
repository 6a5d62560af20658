"""The energy of every authored law is the work against its force."""

import dataclasses

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.types import ModelData
from otwarp.kernels.optics.potentials import trap_energy_term
from otwarp.kernels.optics.traps import trap_force_term
from otwarp.laws import TrapLaw
from otwarp.scene import Trap
from otwarp.simulation.model import Model
from tests.kernels.optics.test_traps import MODELS, SCENE, TRAPS
from tests.kernels.samples import evaluate, on_device
from tests.reference import traps
from tests.reference.rotations import matrix

WAYS, WALKED = 200, 12
"""Ways out of the traps, of random directions; shorter ones, within all reaches, along which work is summed."""

PARTS = 1_000
"""Of a way, over which the work is summed: where a curve ends, one of them is wrong."""

prepare, energy_of = trap_force_term(MODELS).prepare, trap_energy_term((*MODELS, "table_bilinear"))


@wp.kernel(enable_backward=False)
def probe_energy(
    model: ModelData,
    trap: wp.array(dtype=int),
    away: wp.array(dtype=wp.vec3),
    radius: wp.array(dtype=float),
    out: wp.array(dtype=float),
    without: wp.array(dtype=float),
):
    i = wp.tid()
    law = prepare(model.traps, 0, trap[i], radius[i], 0)
    out[i] = energy_of(law, away[i])
    law.model = -1
    without[i] = energy_of(law, away[i])


def test_energy_is_the_work_against_the_force(device):
    """Of four laws, scaled to the sphere or not; of a model without a potential it is NaN."""
    random = np.random.default_rng(2)
    index = random.integers(0, len(TRAPS), WAYS)
    radius = random.uniform(0.8, 2.0, WAYS).astype(np.float32)
    way = random.normal(size=(WAYS, 3))
    away = (way / np.linalg.norm(way, axis=1, keepdims=True) * random.uniform(0, 1.9, (WAYS, 1))).astype(np.float32)
    away[:WALKED] *= 0.6  # of two curves together nothing is left beyond the larger cutoff, whatever the energy there
    model = Model.build(SCENE, device=device)
    inputs = [model.data, *on_device(device, (index, int), (away, wp.vec3), (radius, float))]
    energy, without = evaluate(probe_energy, WAYS, inputs, [wp.float32, wp.float32], device)
    assert np.all(np.isnan(without))
    for n, (i, d, r) in enumerate(zip(index, away.astype(float), radius.astype(float), strict=True)):
        trap = dataclasses.replace(TRAPS[i], equilibrium=0.0)
        assert energy[n] == pytest.approx(twin(trap, d, r), rel=1e-5, abs=1e-6)
        if n < WALKED:
            path = (np.arange(PARTS) + 0.5)[:, None] / PARTS * d
            work = -np.mean([traps.sphere_force(trap, np.zeros(3), 1.0, place, r) @ d for place in path])
            assert energy[n] == pytest.approx(work, rel=2e-3, abs=1e-4)


def twin(trap: Trap, away: np.ndarray, radius: float) -> float:
    """Energy per power [pN·µm per mW] in float64: of one curve, or of those across and along the beam."""

    def part(law: TrapLaw, d: float) -> float:
        s = traps.scale(law, radius)
        return traps.potential(law, d * s, trap.model) / s / law.power

    if trap.axial is None:
        return part(trap.radial, float(np.linalg.norm(away)))
    z = float(away @ matrix(np.asarray(trap.orientation))[:, 2])
    return part(trap.radial, float(np.sqrt(max(away @ away - z * z, 0.0)))) + part(trap.axial, abs(z))
