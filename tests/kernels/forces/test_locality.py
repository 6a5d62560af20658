"""Which bodies move otherwise elsewhere."""

import dataclasses

import numpy as np
import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData
from otwarp.kernels.forces.locality import moves_with_place, needs_place, needs_place_term
from otwarp.kernels.forces.table import FORCES, parametric
from otwarp.simulation.model import Model
from tests.kernels.forces.setups import by_size, scene
from tests.kernels.samples import evaluate


def test_place_matters_to_traps_and_to_a_body_whose_weight_turns_it():
    assert needs_place(Features(bodies=1, traps=1, trap_models=("harmonic_isotropic",)))
    assert needs_place(Features(bodies=1, gravity=True, rigid=True))
    assert not needs_place(Features(bodies=1, gravity=True))
    assert not needs_place(Features(bodies=1, forces=(FORCES["external"].parametric,)))


def test_place_matters_in_a_flow_that_varies_and_to_what_any_flow_turns():
    assert not moves_with_place(Features(flow="uniform"), rigid=False)
    assert moves_with_place(Features(flow="uniform"), rigid=True)
    assert all(moves_with_place(Features(flow="shear"), rigid=kind) for kind in (False, True))
    assert not needs_place(Features(flow="uniform"))


def test_a_constant_force_on_spheres_turns_a_body():
    row = parametric(by_size.body_force, "", "", local=False)
    assert not row.is_local(rigid=False)
    assert row.is_local(rigid=True)


def of_bodies(model: Model) -> list[bool]:
    """What a kernel finds of the bead and of the robot."""
    needs = needs_place_term(model.features)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(model: ModelData, out: wp.array(dtype=wp.int32)):
        b = wp.tid()
        out[b] = wp.where(needs(model, b), 1, 0)

    (found,) = evaluate(probe, 2, [model.data], [wp.int32], str(model.device))
    return [bool(n) for n in np.ravel(found)]


def test_only_bodies_that_a_local_force_acts_on_are_looked_at_again(device):
    """A constant force and the weight of a bead depend on no place; weight turns the robot."""
    assert of_bodies(Model.build(scene(), device=device)) == [False, True]
    trapped = Model.build(dataclasses.replace(scene(traps=1), bodies=scene().bodies), device=device)
    assert of_bodies(trapped) == [True, True]
