"""Thermal rotation limits the step, and what it makes wrong is what simulations show."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.scene import Scene, Settings
from otwarp.simulation.model import Model
from otwarp.simulation.packing.bodies import mobilities
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.time_step.rotors import Rotor, rotors
from otwarp.units import BOLTZMANN
from tests.simulation.setups import robot, sphere_body

SMALL = (((0.0, 0.0, -0.1), 0.1), ((0.0, 0.0, 0.1), 0.1))
"""Two touching spheres of 0.1 µm, whose axis turns by D_r = 49 a second."""

WORLDS = 200_000
SIGMAS = 5.0


def dimer(**settings) -> Scene:
    return Scene(bodies=(robot("Dimer", shape=SMALL, trapped=False),), settings=Settings(**settings))


def of(scene: Scene, integrator: str = "heun") -> tuple[Rotor, Model]:
    model = Model.build(scene, device="cpu")
    return rotors(model.scene, mobilities(scene), model.values, model.loads, INTEGRATORS[integrator])[0], model


@pytest.mark.parametrize("accuracy", [0.001, 0.01])
def test_rotation_limits_the_step(accuracy):
    """With a frame of 1/60 s the step was 0.82 / D_r, at any accuracy."""
    rotor, model = of(dimer(accuracy=accuracy))
    assert model.scales.chosen_by == "rotational diffusion and wanted accuracy"
    assert rotor.turning.max() * model.time_step <= 0.5
    assert 0.3 * accuracy < max(abs(model.scales.errors[name]) for name in ("orientation", "axis")) <= 0.7 * accuracy


def test_a_lone_sphere_has_no_orientation():
    model = Model.build(Scene(bodies=(sphere_body("B", radius=0.05, trapped=False),)), device="cpu")
    assert model.scales.chosen_by == "frame interval"
    assert model.scales.errors == {}


def isotropic(**how) -> Rotor:
    moving = np.diag([1.0, 1.0, 1.5])
    return Rotor(turning=np.ones(3), moving=moving, noise="gaussian", **{"frozen": True, "shared": False, **how})


@pytest.mark.parametrize("step", [0.01, 0.1, 0.5])
def test_closed_forms_of_an_isotropic_rotor(step):
    """⟨n·n'⟩ = ⅓ + ⅔ (1 − s) e^{−s/2} with the variance s of the rotation vector about each axis."""
    for s, rotor in ((2 * step, isotropic(second_order=False)),
                     (2 * step * (1 - step / 6), isotropic(second_order=True))):  # fmt: skip
        kept = 1 / 3 + 2 / 3 * (1 - s) * np.exp(-s / 2)
        assert rotor.orientation_error(step) == pytest.approx(-np.log(kept) / (2 * step) - 1, abs=1e-6)
    mean = 3.5 / 3 + (1.5 - 3.5 / 3) * -np.expm1(-6 * step) / (6 * step)
    assert isotropic(second_order=False).axis_error(step) == pytest.approx(1.5 / mean - 1, rel=1e-9)


def test_noise_of_other_distributions():
    """Three-point deviates have the fourth moments that second order needs, uniform ones have not."""
    errors = {n: abs(dataclasses.replace(isotropic(second_order=True), noise=n).orientation_error(0.05))
              for n in ("gaussian", "threePoint", "uniform")}  # fmt: skip
    assert max(errors["gaussian"], errors["threePoint"]) < 3e-4
    assert errors["uniform"] > 5e-3


@pytest.mark.thorough
def test_a_free_dimer_turns_and_moves_as_it_should(device):
    """At D_r dt = 0.3: orientations and displacements along the axis after one, two and three steps, by closed forms.

    With variances 2 D_r dt and axes of the start of the step orientations were 1, 2 and 4 % off, displacements 4 %
    after one step. Standard errors 0.15 % to 0.7 %, and 0.3 %.
    """
    rotor, _ = of(dimer())
    across, along = np.sort(np.diag(rotor.moving))[[0, 2]]
    slow = float(rotor.turning.min())
    sim = Simulation(dimer(time_step=0.3 / slow), worlds=WORLDS, device=device, seed=3)
    errors = sim.model.scales.errors
    assert abs(errors["orientation"]) < 0.007
    assert abs(errors["axis"]) < 0.006
    start = sim.state.position.numpy()[:, 0].astype(float)
    for _ in range(3):
        sim.step(1)
        turns = Rotation.from_quat(sim.state.orientation.numpy()[:, 0].astype(float))
        cosine = turns.apply([0.0, 0.0, 1.0])[:, 2]
        kept = np.exp(-2.0 * slow * sim.time)
        noise = cosine.std() / kept / np.sqrt(WORLDS)
        allowed = abs(errors["orientation"]) * 2.0 * slow * sim.time + SIGMAS * noise
        assert cosine.mean() / kept == pytest.approx(1.0, abs=allowed)
        moved = (sim.state.position.numpy()[:, 0, 2] - start[:, 2]) ** 2
        mean = (2 * across + along) / 3
        exact = 2 * mean * sim.time + 4 / 3 * (along - across) * -np.expm1(-6 * slow * sim.time) / (6 * slow)
        allowed = abs(errors["axis"]) + SIGMAS * np.sqrt(2.0 / WORLDS)
        assert moved.mean() / exact == pytest.approx(1.0, abs=allowed)


def test_rotation_diffuses_as_einstein_says():
    """The principal values are k_B T over the rotational friction, 3.74 times a sphere's across the axis of a dimer
    (Nir & Acrivos 1973, doi:10.1017/S0022112073000479)."""
    rotor, model = of(dimer())
    sphere = BOLTZMANN * model.scene.medium.temperature / (model.scene.medium.viscosity * 8 * np.pi * 0.1**3)
    assert rotor.turning.min() == pytest.approx(sphere / 3.74, rel=0.02)
