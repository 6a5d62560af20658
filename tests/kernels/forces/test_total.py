"""The sum of the active rows of `FORCES`."""

import functools

import numpy as np

from otwarp.kernels.core.features import Features
from otwarp.kernels.forces.gravity import weight_of_body
from otwarp.kernels.forces.total import body_stiffness_total, body_total, sphere_total
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.bodies import weight
from tests.kernels.forces.setups import FOCI, PUSH, ROUNDING, on_body, on_sphere, places, scene, turning
from tests.kernels.forces.test_traps import springs
from tests.simulation.setups import STIFFNESS


def test_a_sphere_feels_all_of_them(device):
    model = Model.build(scene(traps=2), device=device)
    force = on_sphere(model, functools.partial(sphere_total, what="force"))
    expected = springs(places()[0], FOCI[:2]) + PUSH - [0.0, 0.0, weight(model.scene, model.scene.bodies[0])]
    np.testing.assert_allclose(force, expected, atol=ROUNDING * 4.0 * STIFFNESS)


def test_a_body_feels_all_that_act_on_it(device):
    """The external force is the bead's alone."""
    options = StepOptions(forces=(turning(strength={"/World/Robot": 0.7}),))
    model = Model.build(scene(), device=device, options=options)
    force, torque = on_body(model, body_total)
    weight_alone, by_weight = on_body(model, weight_of_body)
    np.testing.assert_array_equal(force, weight_alone)
    np.testing.assert_allclose(torque, by_weight + np.array([0.0, 0.0, 0.7]), atol=ROUNDING * np.abs(by_weight).max())


def test_without_forces_the_sum_is_empty():
    bare = Features(rigid=True)
    made = (sphere_total(bare, "force"), sphere_total(bare, "stiffness"), body_total(bare), body_stiffness_total(bare))
    assert all(total.func.__name__ == "zero" for total in made)
