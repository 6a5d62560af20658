"""A touching dimer in shear flow tumbles as its own resistance problem says, and close to Jeffery's orbit.

The velocity of a force-free, torque-free pair follows from the grand resistance of two spheres in the flow at their
centres: Kᵀ R (u∞ − K V) = 0 with R the inverse of the Rotne–Prager–Yamakawa mobility, computed here by pygrpy. For a
body of revolution the orbit is Jeffery's with an equivalent axis ratio r (Bretherton 1962,
doi:10.1017/S002211206200124X); for touching spheres r = 1.98 (Nir & Acrivos 1973, doi:10.1017/S0022112073001527), which
two spheres coupled as points only approach and a surface of blobs reaches.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from pygrpy import grpy_tensors
from scipy.integrate import solve_ivp

from otwarp.scene import Flow, Medium, Scene, Settings
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import COLD, VISCOSITY, robot
from tests.validation.poses import matrices, pose

SHEAR = 10.0
"""[1/s]"""
DIMER = (((-1.0, 0.0, 0.0), 1.0), ((1.0, 0.0, 0.0), 1.0))

TOUCHING = 1.98
"""Equivalent axis ratio of two equal touching spheres."""
MOBILITY_ACCURACY = 0.01
"""Of the ratio, as of any mobility of the default accuracy."""

STEP_ERROR = 2e-4
"""Relative error of an angular velocity after a turn at 1e-3 rad per step, second order in the mean; and float32."""


def skew(v: np.ndarray) -> np.ndarray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0.0]])


def motion(axis: np.ndarray) -> np.ndarray:
    """(6,) velocity and angular velocity of the force-free pair with this axis, in u = γ̇ z x̂, centre at the origin."""
    places = np.array([-axis, axis])
    mobility = np.asarray(grpy_tensors.mu(places, np.ones(2)))
    # pygrpy orders all velocities, then all angular velocities
    rigid = np.zeros((12, 6))
    flow = np.zeros(12)
    for i, x in enumerate(places):
        rigid[3 * i : 3 * i + 3, :3] = np.eye(3)
        rigid[3 * i : 3 * i + 3, 3:] = -skew(x)
        rigid[6 + 3 * i : 9 + 3 * i, 3:] = np.eye(3)
        flow[3 * i] = SHEAR * x[2]
        flow[6 + 3 * i + 1] = 0.5 * SHEAR
    resistance = np.linalg.inv(mobility)
    return np.linalg.solve(rigid.T @ resistance @ rigid, rigid.T @ resistance @ flow)


def scene(time_step: float, accuracy: float) -> Scene:
    """The dimer with the mobility of two RPY spheres (accuracy 0) or of a surface of blobs."""
    flow = Flow(prim="/World/F", kind="shear", shear_rate=SHEAR)
    body = dataclasses.replace(robot("Dimer", shape=DIMER), mobility_accuracy=accuracy)
    return Scene(
        medium=Medium(temperature=COLD, viscosity=VISCOSITY),
        bodies=(body,),
        flow=flow,
        settings=Settings(time_step=time_step),
    )


def axes(sim: Simulation) -> np.ndarray:
    return matrices(pose(sim)[1])[:, :, 0]


def bretherton() -> tuple[float, float]:
    """(Λ, r) from the angular velocities of the dimer along and across the flow: φ̇ = γ̇/2·(1 ± Λ)."""
    fast, slow = motion(np.array([0.0, 0.0, 1.0]))[4], motion(np.array([1.0, 0.0, 0.0]))[4]
    ratio = (fast - slow) / (fast + slow)
    assert fast + slow == pytest.approx(SHEAR)
    return ratio, float(np.sqrt((1.0 + ratio) / (1.0 - ratio)))


def half_turn(device: str, accuracy: float) -> float:
    """Time in which a dimer that starts along the flow turns by π in the plane of shear [s]."""
    sim = Simulation(scene(1e-4, accuracy), worlds=1, seed=141, device=device)
    times, angles = [0.0], [0.0]
    while abs(angles[-1]) < np.pi + 0.05:
        sim.step(20)
        a = axes(sim)[0]
        # about y from x towards −z, unwrapped
        angle = np.arctan2(-a[2], a[0])
        times.append(sim.time)
        angles.append(angle + 2.0 * np.pi * np.round((angles[-1] - angle) / (2.0 * np.pi)))
    return float(np.interp(np.pi, angles, times))


def jeffery_half_turn(ratio: float) -> float:
    """π/γ̇·(r + 1/r) [s]."""
    return np.pi / SHEAR * (ratio + 1.0 / ratio)


@pytest.mark.thorough
def test_half_turn_of_two_spheres(expect_law, device):
    """A dimer of two RPY spheres in the plane of shear turns over in π/γ̇·(r + 1/r), r from pygrpy.

    Source: Jeffery 1922, doi:10.1098/rspa.1922.0078; Bretherton 1962, doi:10.1017/S002211206200124X.
    """
    expected = jeffery_half_turn(bretherton()[1])
    expect_law("half turn of two RPY spheres [s]", half_turn(device, 0.0), expected, STEP_ERROR * expected)


@pytest.mark.thorough
def test_half_turn_of_touching_spheres(expect_law, device):
    """With the default mobility a touching dimer turns over as the exact equivalent axis ratio r = 1.98 says.

    Source: Nir & Acrivos 1973, doi:10.1017/S0022112073001527.
    """
    expected, upper = (jeffery_half_turn(TOUCHING * f) for f in (1.0, 1.0 + MOBILITY_ACCURACY))
    found = half_turn(device, MOBILITY_ACCURACY)
    expect_law("half turn of a touching dimer [s]", found, expected, STEP_ERROR * expected, bias=upper - expected)


@pytest.mark.thorough
def test_orbit_out_of_the_plane(expect_law, device):
    """Axes that start anywhere follow the integral of the same resistance problem in float64.

    Source: Jeffery 1922, doi:10.1098/rspa.1922.0078, for the dimer's own Λ; RPY by pygrpy.
    """
    rng = np.random.default_rng(5)
    worlds = 6
    turn = rng.standard_normal((worlds, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    sim = Simulation(scene(5e-5, 0.0), worlds=worlds, seed=142, device=device)
    sim.set_state(orientation=turn[:, None])
    start = axes(sim)
    sim.run(0.5)
    got = axes(sim)
    for w in range(worlds):
        orbit = solve_ivp(
            lambda t, a: np.cross(motion(a / np.linalg.norm(a))[3:], a),
            (0.0, sim.time),
            start[w],
            rtol=1e-8,
            atol=1e-10,
        )
        expect_law(f"axis {w + 1} after γ̇t = {SHEAR * sim.time:g}", got[w], orbit.y[:, -1], STEP_ERROR)
