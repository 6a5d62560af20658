"""The constants of a lone sphere: Stokes mobility, thermal spread, and the noise that has it."""

import dataclasses

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.bodies.bead import bead_constants_term, bead_noise_term
from otwarp.kernels.core.types import ControlData, ModelData
from otwarp.scene import Medium
from otwarp.simulation.model import Model
from otwarp.simulation.state import Control
from tests.simulation.setups import ENERGY, VISCOSITY, bead_scene, drag

STEP = 1e-4
WORLDS = 20_000


@pytest.fixture(scope="module")
def found(device) -> tuple[np.ndarray, np.ndarray]:
    """Per world (mobility·dt, spread, weight) and one kick."""
    scene = dataclasses.replace(bead_scene(time_step=STEP), medium=Medium(viscosity=VISCOSITY))
    twice = np.where(np.arange(WORLDS) % 2, 2.0, 1.0)
    model = Model.build(scene, worlds=WORLDS, seed=3, device=device, parameters={"medium_viscosity": VISCOSITY * twice})
    f = dataclasses.replace(model.features, lanes=False)
    constants_of, noise = bead_constants_term(f), bead_noise_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(model: ModelData, control: ControlData, about: wp.array(dtype=wp.vec3), kick: wp.array(dtype=wp.vec3)):
        world = wp.tid()
        bead = constants_of(model, control, world, 0)
        about[world] = wp.vec3(bead.mobility_dt, bead.spread, bead.weight)
        kick[world] = noise(model, bead, world, 0, wp.vec3(0.0), wp.int64(5))

    about, kick = (wp.zeros(WORLDS, dtype=wp.vec3, device=device) for _ in range(2))
    wp.launch(probe, dim=WORLDS, inputs=[model.data, Control.start(model).data(), about, kick], device=device)
    return about.numpy().astype(float), kick.numpy().astype(float)


def test_mobility_is_that_of_stokes_at_each_worlds_viscosity(found):
    mobility, spread, _ = found[0].T
    np.testing.assert_allclose(mobility[:2], STEP / drag(1.0) / np.array([1.0, 2.0]), rtol=1e-6)
    # fluctuation and dissipation: s² = 2 k_BT μ dt
    np.testing.assert_allclose(spread**2, 2.0 * ENERGY * mobility, rtol=1e-5)


def test_noise_has_the_spread_and_no_direction(found):
    """Variances along and across the axes, one world each: standard error √(2/n) of a variance, 5σ."""
    scaled = found[1] / found[0][:, 1:2]
    covariance = scaled.T @ scaled / WORLDS
    np.testing.assert_allclose(covariance, np.eye(3), atol=5.0 * np.sqrt(2.0 / WORLDS))
    assert np.all(np.abs(scaled.mean(axis=0)) < 5.0 / np.sqrt(WORLDS))
