"""A scheme of second order for linear forces, chosen by a scene."""

import math

import pytest

import otwarp as ot
from otwarp.scene import Body, Scene, Settings, Sphere


@ot.force(stiffness="pN/µm")
def spring(body: ot.ForceInput, stiffness: float):
    return -stiffness * body.position


def test_a_spring_decays_to_second_order(device):
    ball = Body(prim="/World/B", position=(1.0, 0.0, 0.0), spheres=(Sphere(prim="/World/B/S", radius=1.0),))
    scene = Scene(bodies=(ball,), settings=Settings(brownian=False, integrator="ralston"))
    rate = 2.0 / (6.0 * math.pi * scene.medium.viscosity)
    for steps in (10, 20):
        z = 1.0 / steps
        sim = ot.Simulation(
            scene, device=device, precision="float64", time_step=z / rate, forces=[spring(stiffness=2.0)]
        )
        sim.step(steps)
        error = sim.state.position.numpy()[0, 0, 0] / math.exp(-1.0) - 1.0
        assert error == pytest.approx(steps * z**3 / 6.0, rel=0.2)  # z³/6 is lost in each step
