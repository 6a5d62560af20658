"""A force read off the signature of its function."""

from __future__ import annotations

import warp as wp

import otwarp as ot
from otwarp.kernels.body_forces.body_force import BodyForce, ForceParameter


def pull(body: ot.ForceInput, stiffness: float, centre: wp.vec3 = (0.0, 0.0, 1.0)) -> wp.vec3:
    return -stiffness * (body.position - centre)


def twist(body: ot.ForceInput, strength: float) -> ot.Wrench:
    return ot.Wrench(wp.vec3(0.0), wp.vec3(0.0, 0.0, strength))


UNITS = {"stiffness": "pN/µm", "centre": "µm"}


def test_parameters_are_the_arguments_with_their_units():
    force = BodyForce.of(pull, UNITS)
    assert force.parameters == (
        ForceParameter("stiffness", "pN/µm"),
        ForceParameter("centre", "µm", width=3, default=(0.0, 0.0, 1.0)),
    )
    assert (force.name, force.acts_on, force.turns) == ("pull", "body", False)
    assert force.full_name("centre") == "pull_centre"
    assert BodyForce.of(twist, {"strength": "pN·µm"}).turns


def test_equal_forces_are_those_that_do_the_same():
    force = BodyForce.of(pull, UNITS)
    assert BodyForce.of(pull, UNITS, slope=2.0) == force
    assert BodyForce.of(pull, UNITS, acts_on="spheres") != force
    assert BodyForce.of(pull, UNITS | {"centre": "nm"}).digest != force.digest


def test_a_force_is_compiled_once_per_precision():
    force = BodyForce.of(pull, UNITS)
    single, double = force.compiled("float32"), force.compiled("float64")
    assert isinstance(single, wp.Function)
    assert single is force.compiled("float32")
    assert double is force.compiled("float64")
    assert double is not single
