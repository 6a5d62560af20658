"""Two spheres in shear flow: alone each follows the liquid, together each is carried by the other's force as well.

Velocities are u(x_i) + Σ_j μ_ij F_j with the mobilities of Rotne, Prager and Yamakawa for unequal spheres, taken
from pygrpy and integrated in float64. One sphere is held by a trap and sinks, the other comes past it, nearer than two
radii: the shear changes the way between them, and so the coupling, by its own size.
"""

from __future__ import annotations

import numpy as np
import pytest
from pygrpy import grpy_tensors
from scipy.integrate import solve_ivp

from otwarp.scene import Flow, Medium, Scene, Settings
from otwarp.simulation.simulation import Simulation
from otwarp.units import STANDARD_GRAVITY
from tests.simulation.setups import POWER as FULL_POWER
from tests.simulation.setups import STIFFNESS, VISCOSITY, harmonic, sphere_body

SHEAR = 8.0
"""[1/s]"""
RADII = np.array([1.0, 0.7])
HEAVY = 4000e-12
"""Density [pN·s²/µm⁴] that gives both a weight of some 0.1 pN."""
POWER = 0.1
"""Of the trap [mW]: 0.1 pN/µm, so that the held sphere strays by as much as the other's force moves it."""
START = np.array([[0.2, -0.1, 0.0], [-4.0, 0.6, 2.0]])

TIME, STEP = 0.5, 2e-4
PATH_ERROR = 2e-6
"""Of a place in float64 [µm]: Heun's steps of 2e-4 s leave (8/s·dt)²/6 = 4e-7 of 4 µm, in each second anew."""


def pair(*, coupled: bool, **settings) -> Scene:
    bodies = tuple(
        sphere_body(name, tuple(place), radius=radius, density=HEAVY, trapped=name == "Held")
        for name, place, radius in zip(("Held", "Passing"), START, RADII, strict=True)
    )
    return Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=bodies,
        traps=(harmonic("Trap", power=POWER),),
        flow=Flow(prim="/World/Flow", kind="shear", shear_rate=SHEAR),
        settings=Settings(gravity=True, brownian=False, coupling=coupled, time_step=STEP, **settings),
    )


def mobility(place: np.ndarray, coupled: bool) -> np.ndarray:
    """(6, 6) of two spheres that turn freely, velocities from forces."""
    whole = np.asarray(grpy_tensors.mu(place, RADII))[:6, :6] / VISCOSITY
    return whole if coupled else np.kron(np.eye(2), np.ones((3, 3))) * whole


def loads(place: np.ndarray) -> np.ndarray:
    """(2, 3) trap and weight [pN]."""
    volume = 4.0 / 3.0 * np.pi * RADII**3
    force = np.zeros((2, 3))
    force[:, 2] = -(HEAVY - Medium().density) * volume * STANDARD_GRAVITY
    force[0] -= STIFFNESS * POWER / FULL_POWER * place[0]
    return force


def path(times: np.ndarray, coupled: bool) -> np.ndarray:
    """(k, 2, 3) places in float64."""

    def velocity(_: float, flat: np.ndarray) -> np.ndarray:
        place = flat.reshape(2, 3)
        flow = np.zeros((2, 3))
        flow[:, 0] = SHEAR * place[:, 2]
        return flow.ravel() + mobility(place, coupled) @ loads(place).ravel()

    found = solve_ivp(velocity, (0.0, times[-1]), START.ravel(), t_eval=times, rtol=1e-10, atol=1e-12)
    assert found.success
    return found.y.T.reshape(-1, 2, 3)


@pytest.mark.thorough
@pytest.mark.parametrize("coupled", [True, False], ids=["coupled", "apart"])
def test_two_spheres_in_shear(expect_law, device, coupled):
    """Paths of a held and a passing sphere, each with its weight, at ten times.

    Source: Rotne & Prager 1969, doi:10.1063/1.1670977; Zuk et al. 2014, doi:10.1017/jfm.2013.668, by pygrpy.
    """
    times = np.linspace(0.1, 1.0, 10) * TIME
    expected = path(times, coupled)
    nearest = np.linalg.norm(expected[:, 0] - expected[:, 1], axis=1).min()
    assert RADII.sum() < nearest < 1.3 * RADII.sum()
    # each sphere's force moves the other by far more than the comparison leaves
    assert np.abs(path(times, True) - path(times, False))[-1].max(axis=-1).min() > 1e4 * PATH_ERROR
    sim = Simulation(pair(coupled=coupled), device=device, precision="float64")
    found = []
    for time in times:
        sim.run(time - sim.time)
        found.append(sim.state.position.numpy()[0].astype(float))
    name = "coupled spheres" if coupled else "spheres apart"
    for body, what in enumerate(("held", "passing")):
        expect_law(f"{name}: place of the {what} one [µm]", np.array(found)[:, body], expected[:, body], PATH_ERROR)
