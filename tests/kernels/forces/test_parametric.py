"""Forces with parameters per body in the step: where their numbers lie, and on whom they act."""

import functools

import numpy as np

from otwarp.kernels.forces.parametric import first_parameter, parametric_on_body, parametric_on_sphere
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from tests.kernels.forces.setups import PUSH, by_size, on_body, on_sphere, scene, turning


def test_numbers_lie_one_force_after_the_other():
    forces = (turning.body_force, by_size.body_force, turning.body_force)
    assert [first_parameter(forces, n) for n in range(4)] == [0, 1, 2, 3]


def test_a_force_acts_on_the_bodies_that_it_names(device):
    options = StepOptions(forces=(turning(strength={"/World/Robot": 0.7}),))
    model = Model.build(scene(), device=device, options=options)
    external, turn = (functools.partial(parametric_on_sphere, index=n) for n in range(2))
    np.testing.assert_allclose(on_sphere(model, external), [PUSH] * 200, rtol=1e-7)
    assert not np.any(on_sphere(model, turn))
    force, torque = on_body(model, functools.partial(parametric_on_body, index=1))
    assert not np.any(force)
    np.testing.assert_allclose(torque, [[0.0, 0.0, 0.7]] * 200, rtol=1e-7)
    assert not np.any(on_body(model, functools.partial(parametric_on_body, index=0)))
