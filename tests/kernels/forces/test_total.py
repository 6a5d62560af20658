"""The sum of the active rows of `FORCES`."""

import dataclasses
import functools

import numpy as np
import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData, mat66
from otwarp.kernels.forces.gravity import weight_of_body
from otwarp.kernels.forces.table import FORCES
from otwarp.kernels.forces.total import body_stiffness_total, body_total, sphere_total
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.packing.bodies import weight
from otwarp.simulation.state import Control, State
from tests.kernels.forces.setups import FOCI, PUSH, ROUNDING, on_body, on_sphere, places, scene, turning
from tests.kernels.forces.test_traps import springs
from tests.kernels.samples import evaluate, on_device
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


def test_stiffnesses_of_two_rows_add_up(device, monkeypatch):
    """Of a second force of the traps' own the stiffness is twice as much."""
    model = Model.build(scene(traps=2), device=device)
    once = body_stiffness(model)
    assert np.any(once)
    monkeypatch.setitem(FORCES, "again", dataclasses.replace(FORCES["traps"], name="again"))
    np.testing.assert_array_equal(body_stiffness(model), 2.0 * once)


def body_stiffness(model: Model) -> np.ndarray:
    """(200, 6, 6) of the robot at `places`."""
    term = body_stiffness_total(model.features)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(
        model: ModelData, control: ControlData, state: StateData, position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat), out: wp.array(dtype=mat66),
    ):  # fmt: skip
        i = wp.tid()
        out[i] = term(model, control, state, 0, 1, Pose(position[i], rotation[i]), wp.float64(0.0))

    position, rotation = places()
    inputs = [model.data, Control.start(model).data(), State.start(model).data()]
    inputs += on_device(str(model.device), (position, wp.vec3), (rotation, wp.quat))
    return evaluate(probe, len(position), inputs, [mat66], str(model.device))[0]


def test_without_forces_the_sum_is_empty():
    bare = Features(rigid=True)
    made = (sphere_total(bare, "force"), sphere_total(bare, "stiffness"), body_total(bare), body_stiffness_total(bare))
    assert all(total.func.__name__ == "zero" for total in made)
