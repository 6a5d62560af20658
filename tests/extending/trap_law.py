"""A Gaussian trap, from a file to its force and to the way that a bead goes in it."""

import numpy as np
import pytest

import otwarp as ot
from otwarp.laws import TrapLaw
from otwarp.scene import Body, SceneBuilder, Settings, Sphere, Track, Trap
from otwarp.teleop.operators import authored_law

STIFFNESS, WIDTH, POWER, START = 2.0, 0.5, 3.0, 0.8
"""pN/µm at 1 mW, µm, mW, µm."""


def force(d: float) -> float:
    return -POWER * STIFFNESS * d * np.exp(-0.5 * (d / WIDTH) ** 2)


def test_a_gaussian_trap(tmp_path, device):
    law = TrapLaw(stiffness=STIFFNESS, threshold=WIDTH, cutoff=2.0, power=1.0)
    place, power = Track.constant((0.0, 0.0, 0.0)), Track.constant(POWER)
    builder = SceneBuilder(settings=Settings(brownian=False, integrator="exponential"))
    builder.add(Trap(prim="/World/T", model="gaussian", position=place, power=power, radial=law))
    ball = Sphere(prim="/World/B/S", radius=1.0)
    builder.add(Body(prim="/World/B", position=(START, 0.0, 0.0), spheres=(ball,)))
    scene = ot.Scene.load(builder.save(tmp_path / "gaussian.usda"))
    drag = 6.0 * np.pi * scene.medium.viscosity
    sim = ot.Simulation(scene, device=device, precision="float64", time_step=0.05 * drag / (POWER * STIFFNESS))
    assert sim.readout.trap_force.numpy()[0, 0, 0] == pytest.approx(force(START), rel=1e-9)
    sim.step(40)
    x = START
    h = sim.time / 4000
    for _ in range(4000):
        x += h * force(x + 0.5 * h * force(x) / drag) / drag
    assert sim.state.position.numpy()[0, 0, 0] == pytest.approx(x, rel=1e-3)
    with pytest.raises(ot.InputError, match="a hand must be one of harmonic, piecewise, table, exact"):
        authored_law(scene.traps[0], 1.0)
