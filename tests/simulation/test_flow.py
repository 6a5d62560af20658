"""Beads that go along with flows given as data and in channels of rectangular section."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.scene import Flow, Medium, Scene, Settings
from otwarp.scene.flow_grid import FlowGrid
from otwarp.scene.flow_profile import drive, flow_velocity
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import COLD, obstacle, robot, sphere_body


def drifting(flow: Flow, **more) -> Scene:
    return Scene(
        medium=Medium(temperature=COLD),
        bodies=(sphere_body("Bead", (0.5, 2.0, -1.0), trapped=False),),
        flow=flow,
        settings=Settings(time_step=1e-3, **more),
    )


CHANNEL = Flow(prim="/World/F", kind="rectangular", speed=40.0, half_width=7.0, half_height=5.0)


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_a_bead_drifts_with_the_mean_of_the_channel_over_its_surface(precision, device):
    """ẋ = u(y, z) − a²G/6."""
    sim = Simulation(drifting(CHANNEL), device=device, precision=precision)
    start = sim.state.position.numpy().astype(float)[0, 0]
    sim.step(1000)
    moved = sim.state.position.numpy().astype(float)[0, 0] - start
    speed = flow_velocity(CHANNEL, start[None])[0, 0] - 40.0 * drive(CHANNEL) / 6.0
    assert moved[0] == pytest.approx(speed, rel=1e-4)
    assert np.abs(moved[1:]).max() < 1e-3


def test_a_bead_circles_in_a_field_of_rotation(device):
    """u = ω × r as data: after a turn it is back, to Heun's error of third order."""
    places = np.linspace(-4.0, 4.0, 9)
    x, y, z = np.meshgrid(places, places, places, indexing="ij")
    field = FlowGrid(low=(-4.0,) * 3, spacing=(1.0,) * 3, velocity=2.0 * np.pi * np.stack([-y, x, 0 * z], -1))
    assert field.divergence[0] < 1e-12
    sim = Simulation(drifting(Flow(prim="/World/F", kind="grid", field=field)), device=device)
    start = sim.state.position.numpy().astype(float)[0, 0]
    sim.step(250)
    quarter = sim.state.position.numpy().astype(float)[0, 0]
    np.testing.assert_allclose(quarter, [-start[1], start[0], start[2]], atol=2e-3)
    sim.step(750)
    np.testing.assert_allclose(sim.state.position.numpy().astype(float)[0, 0], start, atol=5e-3)


def test_a_robot_turns_with_the_field(device):
    """A rigid body in a rotation as data has its angular velocity: every sphere has half the curl."""
    places = np.linspace(-8.0, 8.0, 5)
    x, y, z = np.meshgrid(places, places, places, indexing="ij")
    field = FlowGrid(low=(-8.0,) * 3, spacing=(4.0,) * 3, velocity=0.5 * np.stack([-y, x, 0 * z], -1))
    scene = dataclasses.replace(
        drifting(Flow(prim="/World/F", kind="grid", field=field)), bodies=(robot("Robot", trapped=False),)
    )
    sim = Simulation(scene, device=device)
    sim.step(1000)
    x, y, z, w = sim.state.orientation.numpy().astype(float)[0, 0]
    assert 2.0 * np.arctan2(z, w) == pytest.approx(0.5, rel=2e-3)
    assert np.abs([x, y]).max() < 1e-3


def test_flow_must_stand_at_hydrodynamic_walls(device):
    """At all four walls of the channel it does; a field says where it does not."""
    sides = {
        "Floor": ((0.0, 0.0, -5.0), (0.0, 0.0, 0.0, 1.0)),
        "South": ((0.0, -7.0, 0.0), (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)),
    }
    for name, (place, turn) in sides.items():
        wall = dataclasses.replace(obstacle(name, "plane", place, turn=turn), hydrodynamic=True)
        Simulation(dataclasses.replace(drifting(CHANNEL), obstacles=(wall,)), device=device).step()
        field = FlowGrid(low=(-9.0,) * 3, spacing=(9.0,) * 3, velocity=np.ones((3, 3, 3, 3)))
        scene = drifting(Flow(prim="/World/F", kind="grid", field=field))
        with pytest.raises(ValueError, match=f"/World/{name}: ot:obstacle:hydrodynamic = true: .* its field has 1.73"):
            Simulation(dataclasses.replace(scene, obstacles=(wall,)), device=device)


def test_channels_need_their_sides():
    with pytest.raises(ValueError, match=r"ot:flow:halfWidth = 0.0: must be in \(0, inf\) m for rectangular"):
        drifting(dataclasses.replace(CHANNEL, half_width=0.0)).check()
