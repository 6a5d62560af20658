"""Contacts of scenes with soft ones are solved for what they move the bodies, with the result of the other solver."""

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


PRESSED = 0.005
"""Overlap in which the robots start [µm]: eight contacts of 1 MPa."""


def space_of(scene: Scene, device: str, **how) -> bool:
    return model.Model.build(scene, device=device, options=StepOptions(**how)).features.body_space


def of_modulus(scene: Scene, modulus: float) -> Scene:
    bodies = [
        dataclasses.replace(b, material=dataclasses.replace(b.material, youngs_modulus=modulus)) for b in scene.bodies
    ]
    return dataclasses.replace(scene, bodies=tuple(bodies))


def test_the_scene_says_how_its_contacts_are_solved(device):
    """Cells of 1 kPa among robots of 1 MPa: for moves. All of 1 MPa: for forces."""
    delivery = Scene.load(SCENES / "cell_delivery.usda")
    assert space_of(delivery, device)
    assert not space_of(of_modulus(delivery, 1e6), device)
    # a contact is the softer, the shorter the step
    assert space_of(of_modulus(delivery, 1e6), device, time_step=1e-8)


@pytest.fixture(scope="module")
def both(device):
    """The delivery by either solver, step by step from equal places."""
    scene = Scene.load(SCENES / "cell_delivery.usda")
    with pytest.MonkeyPatch.context() as patch:
        sims = []
        for space in (True, False):
            patch.setattr(model, "body_space", lambda *_, space=space: space)
            sims.append(Simulation(scene, worlds=WORLDS, seed=11, device=device, ends=()))
    assert [s.model.features.body_space for s in sims] == [True, False]
    return sims


@pytest.fixture
def in_contact(both):
    """Both on their way from the start, whatever other tests did with them."""
    for sim in both:
        sim.reset()
        sim.step(STEPS)
    return both


def test_both_solvers_go_the_same_way(in_contact):
    places = [sim.state.position.numpy().astype(float) for sim in in_contact]
    np.testing.assert_allclose(places[0], places[1], atol=SAME)
    loads = [sim.readout.contact_load.numpy().astype(float) for sim in in_contact]
    assert loads[1].mean() > 2.0
    np.testing.assert_allclose(loads[0].mean(axis=0), loads[1].mean(axis=0), rtol=0.02)


def test_the_third_law_holds(in_contact):
    """Robots and cell touch nothing else: contact forces add up to nothing."""
    force = in_contact[0].readout.contact_force.numpy().astype(float)
    assert np.abs(force).max() > 1.0
    np.testing.assert_allclose(force.sum(axis=1), 0.0, atol=1e-5)


def test_stiff_contacts_among_soft_ones(both):
    """Robots whose rings of 1 MPa are pressed together part alike, and stay apart alike."""
    start = both[0].model.start_position()
    half = 0.5 * (start[1] - start[0]) / np.linalg.norm(start[1] - start[0])
    # the rings are the foremost spheres of the robots
    reach = max(s.offset[0] + s.radius for s in both[0].model.scene.bodies[0].spheres)
    reach -= both[0].model.reference[0, 0]
    middle = 0.5 * (start[0] + start[1])
    place = start.copy()
    place[0], place[1] = (middle + way * (2.0 * reach - PRESSED) * half for way in (-1.0, 1.0))
    place[2] = middle + np.array([0.0, 12.0, 0.0])
    for sim in both:
        sim.state.position.assign(np.broadcast_to(place, (WORLDS, *place.shape)).astype(np.float32))
        sim.state.orientation.assign(
            np.broadcast_to(sim.model.start_orientation(), (WORLDS, len(place), 4)).astype(np.float32)
        )
        sim.step(1)
    loads = [sim.readout.contact_load.numpy()[:, :2].astype(float) for sim in both]
    assert loads[1].min() > 1.0
    # a thousandth of the radius left in a gap is a tenth of the overlap
    np.testing.assert_allclose(loads[0], loads[1], rtol=0.1)
    for sim in both:
        sim.step(20)
    places = [sim.state.position.numpy().astype(float) for sim in both]
    np.testing.assert_allclose(places[0], places[1], atol=2.0 * SAME)
