"""Soft contacts are solved for what they move the bodies, with the result of the other solver."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import otwarp.simulation.model as model
from otwarp.scene import Scene
from otwarp.simulation.options import StepOptions
from otwarp.simulation.simulation import Simulation

SCENES = Path(__file__).parents[2] / "scenes"

SAME = 6e-4
"""Places of the two solvers [µm]: each may leave a thousandth of the effective radius, 0.46 µm, in a gap."""

WORLDS, STEPS = 8, 120


def space_of(scene: Scene, device: str, **how) -> str:
    return model.Model.build(scene, device=device, options=StepOptions(**how)).features.body_space


def of_modulus(scene: Scene, modulus: float) -> Scene:
    bodies = [
        dataclasses.replace(b, material=dataclasses.replace(b.material, youngs_modulus=modulus)) for b in scene.bodies
    ]
    return dataclasses.replace(scene, bodies=tuple(bodies))


def test_the_scene_says_which_contacts_are_soft(device):
    """Cells of 1 kPa among robots of 1 MPa: some. All of 300 Pa: all. All of 1 MPa: none."""
    delivery = Scene.load(SCENES / "cell_delivery.usda")
    assert space_of(delivery, device) == "some"
    assert space_of(of_modulus(delivery, 300.0), device) == "all"
    assert space_of(of_modulus(delivery, 1e6), device) == ""
    # a contact is the softer, the shorter the step
    assert space_of(of_modulus(delivery, 1e6), device, time_step=1e-8) == "all"


@pytest.fixture(scope="module")
def both(device):
    """The delivery by either solver, step by step from equal places."""
    scene = Scene.load(SCENES / "cell_delivery.usda")
    with pytest.MonkeyPatch.context() as patch:
        sims = []
        for space in ("some", ""):
            patch.setattr(model, "body_space", lambda *_, space=space: space)
            sims.append(Simulation(scene, worlds=WORLDS, seed=11, device=device))
    assert [s.model.features.body_space for s in sims] == ["some", ""]
    return sims


def test_both_solvers_go_the_same_way(both):
    for sim in both:
        sim.step(STEPS)
    places = [sim.state.position.numpy().astype(float) for sim in both]
    np.testing.assert_allclose(places[0], places[1], atol=SAME)
    loads = [sim.readout.contact_load.numpy().astype(float) for sim in both]
    assert loads[1].mean() > 2.0
    np.testing.assert_allclose(loads[0].mean(axis=0), loads[1].mean(axis=0), rtol=0.02)


def test_the_third_law_holds(both):
    """Robots and cell touch nothing else: contact forces add up to nothing."""
    force = both[0].readout.contact_force.numpy().astype(float)
    assert np.abs(force).max() > 1.0
    np.testing.assert_allclose(force.sum(axis=1), 0.0, atol=1e-5)
