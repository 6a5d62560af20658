"""How true a force is: sums on the device against those of NumPy, and what is said of them."""

import numpy as np
import pytest
import warp as wp

from otwarp.operators.chain import zeros
from otwarp.operators.kernels import fidelity
from otwarp.operators.kernels.fidelity import FidelityData
from otwarp.operators.perception.loop import fidelity_of

WARNING, DIRECTED, PERIOD = 10.0, 1.0, 1e-3


@pytest.fixture(scope="module")
def compared(device):
    """Forces of three worlds of two hands over 400 periods [N], gains [N/pN], sums; the last world stops halfway."""
    rng = np.random.default_rng(8)
    gain = np.array([[0.05, 0.05], [0.0, 0.0], [0.02, 0.01]])
    force, other = (rng.normal(0.0, 8.0, (400, 3, 2, 3)) * gain[..., None] for _ in range(2))
    force[5], other[6] = 0.0, 0.0
    other = 0.7 * force + 0.5 * other
    sums = FidelityData()
    for name, var in FidelityData.vars.items():
        setattr(sums, name, zeros((3, 2), var.type.dtype, wp.get_device(device)))
    for tick in range(400):
        ticks = [tick + 1, tick + 1, min(tick + 1, 200)]
        inputs = [wp.array(rows, dtype=wp.vec3d, device=device) for rows in (force[tick], other[tick])]
        inputs += [wp.array(gain, dtype=wp.float64, device=device), wp.array(ticks, dtype=wp.int32, device=device)]
        wp.launch(fidelity.compare, dim=(3, 2), inputs=[*inputs, WARNING, DIRECTED, sums], device=device)
    return force, other, gain, sums


def test_errors_directions_and_warnings_are_numpys(compared):
    force, other, gain, sums = compared
    found = fidelity_of(sums, gain, PERIOD)
    for world, periods in ((0, 400), (2, 200)):
        f, g, per = force[:periods, world], other[:periods, world], gain[world][:, None]
        error = np.sum((f - g) ** 2, axis=-1)
        assert found["force_rmse"][world] == pytest.approx(np.sqrt(error.mean()), rel=1e-12)
        assert found["force_rmse_pn"][world] == pytest.approx(np.sqrt((error / gain[world] ** 2).mean()), rel=1e-12)
        spread = np.sum((g - g.mean(axis=0)) ** 2)
        assert found["force_r2"][world] == pytest.approx(1.0 - error.sum() / spread, rel=1e-9)
        f, g = f / per, g / per
        size, own = np.linalg.norm(g, axis=-1), np.linalg.norm(f, axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            angle = np.degrees(np.arccos(np.clip(np.sum(f * g, axis=-1) / (size * own), -1.0, 1.0)))
        angle = np.where(own == 0.0, 90.0, angle)
        assert found["direction_error"][world] == pytest.approx(angle[size > DIRECTED].mean(), rel=1e-6)
        warns, loud = size > WARNING, own > WARNING
        for name, flags in (("warned", warns), ("missed", warns & ~loud), ("false", loud & ~warns)):
            assert found[name][world] == pytest.approx(flags.sum() * PERIOD / 2) and flags.any(), name


def test_where_nothing_is_felt_nothing_is_said(compared):
    *_, gain, sums = compared
    assert all(np.isnan(row[1]) for row in fidelity_of(sums, gain, PERIOD).values())


def test_angles_of_small_forces_are_exact(device):
    """Between forces that differ by a billionth of a turn: arccos of a product would say 0."""
    sums = FidelityData()
    for name, var in FidelityData.vars.items():
        setattr(sums, name, zeros((1, 1), var.type.dtype, wp.get_device(device)))
    f, g = ([[[1.0, 0.0, 0.0]]], [[[1.0, 1e-9, 0.0]]])
    inputs = [wp.array(np.array(rows), dtype=wp.vec3d, device=device) for rows in (f, g)]
    inputs += [wp.ones((1, 1), dtype=wp.float64, device=device), wp.ones(1, dtype=wp.int32, device=device)]
    wp.launch(fidelity.compare, dim=(1, 1), inputs=[*inputs, 10.0, 0.5, sums], device=device)
    assert sums.angle.numpy()[0, 0] == pytest.approx(1e-9, rel=1e-6)
