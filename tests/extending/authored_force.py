"""A force that scenes author: written, read back, swept."""

import numpy as np

from otwarp.scene import Body, Scene, SceneBuilder, Settings, Sphere
from otwarp.simulation.simulation import Simulation
from otwarp.units import BOLTZMANN


def test_thermophoresis(tmp_path, device):
    authored = {"thermophoresis_soret": 2.0, "thermophoresis_gradient": (0.0, 0.1, 0.0)}
    builder = SceneBuilder(settings=Settings(brownian=False, time_step=1e-3))
    builder.add(Body(prim="/World/B", spheres=(Sphere(prim="/World/B/S", radius=1.0),), forces=authored))
    file = builder.save(tmp_path / "warm.usda")
    assert "ot:body:temperatureGradient = (0, 100000, 0)" in file.read_text()
    scene = Scene.load(file)
    assert scene.bodies[0].forces == authored
    sweep = {"thermophoresis_soret": [[2.0], [-3.0]]}
    sim = Simulation(scene, worlds=2, device=device, precision="float64", parameters=sweep)
    sim.step(10)
    force = -BOLTZMANN * scene.medium.temperature * 0.1 * np.array([2.0, -3.0])
    drag = 6.0 * np.pi * scene.medium.viscosity
    np.testing.assert_allclose(sim.state.position.numpy()[:, 0, 1], force * sim.time / drag, rtol=1e-9)
