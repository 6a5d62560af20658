"""Weight minus buoyancy, and its torque about the centre of diffusion."""

import numpy as np
import pytest

from otwarp.kernels.forces.force import BodyFacts
from otwarp.kernels.forces.gravity import weight_load, weight_of_body, weight_of_sphere
from otwarp.simulation.model import Model
from otwarp.simulation.packing.bodies import weight
from tests.kernels.forces.setups import HEAVY, ROUNDING, on_body, on_sphere, places, scene
from tests.reference.rotations import matrix


def test_weight_of_a_sphere_and_of_a_body(device):
    model = Model.build(scene(), device=device)
    bead, robot = (weight(model.scene, body) for body in model.scene.bodies)
    assert bead == pytest.approx((HEAVY - 997e-12) * 4.0 / 3.0 * np.pi * 9.80665e6)
    np.testing.assert_allclose(on_sphere(model, weight_of_sphere), [[0.0, 0.0, -bead]] * len(places()[0]), rtol=1e-6)
    force, torque = on_body(model, weight_of_body)
    down = np.array([0.0, 0.0, -robot])
    arm = model.data.body.weight_arm.numpy()[1]
    assert np.linalg.norm(arm) > 0.0
    np.testing.assert_allclose(force, [down] * len(force), rtol=1e-6)
    expected = np.array([np.cross(matrix(q) @ arm, down) for q in places()[1]])
    np.testing.assert_allclose(torque, expected, atol=ROUNDING * robot * np.linalg.norm(arm))


def test_its_load_is_that_of_a_body_that_hangs_level():
    load = weight_load(BodyFacts(weight=-2.0, weight_arm=0.5))
    assert (load.force, load.torque, load.rate) == (2.0, 1.0, 0.0)
