"""A force that a user writes, swept over worlds."""

import numpy as np
from my_forces import motor, thermophoresis

import otwarp as ot
from otwarp.scene import Body, Scene, Settings, Sphere

BALL = Body(prim="/World/bead", spheres=(Sphere(prim="/World/bead/ball", radius=1.0),))
SCENE = Scene(bodies=(BALL,), settings=Settings(brownian=False, time_step=1e-4))


def test_a_force_moves_by_the_mobility(device):
    sweep = {"thermophoresis_soret": [[1.0], [2.0], [4.0]]}  # (worlds, bodies)
    forces = [thermophoresis, motor(torque={"/World/bead": 0.2})]
    sim = ot.Simulation(SCENE, worlds=3, device=device, precision="float64", forces=forces, parameters=sweep)
    sim.step(100)
    moved = sim.state.position.numpy()[:, 0, 2]
    drag = 6.0 * np.pi * SCENE.medium.viscosity * 1.0
    np.testing.assert_allclose(moved, -0.1 * np.array([1.0, 2.0, 4.0]) * sim.time / drag, rtol=1e-9)
    # (worlds, forces, bodies, 3): what each force of the simulation does now
    np.testing.assert_allclose(sim.readout.body_force.numpy()[1, 0, 0], [0.0, 0.0, -0.2])
    np.testing.assert_allclose(sim.readout.body_torque.numpy()[1, 1, 0], [0.0, 0.0, 0.2])
