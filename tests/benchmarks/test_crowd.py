"""The benchmark of crowds measures the crowd that the stepper of a scene would step."""

from __future__ import annotations

import dataclasses
import json

import numpy as np

from benchmarks import crowd
from otwarp.bench.speed import many_body
from otwarp.device import pick_device
from otwarp.scene import Scene, Settings
from otwarp.simulation.simulation import Simulation

COUNT = 1000


def test_repeated_arrays_make_the_same_crowd_as_a_scene(device):
    """Bit for bit over steps that make new lists."""
    one = many_body.ManySpheres(COUNT, pick_device(device))
    first = one.model.scene.bodies[0]
    bodies = tuple(
        dataclasses.replace(first, prim=f"/World/B{i}", position=tuple(map(float, p)))
        for i, p in enumerate(many_body.start_places(COUNT))
    )
    scene = Scene(bodies=bodies, settings=Settings(time_step=many_body.time_step()))
    whole = Simulation(scene, device=device)
    assert whole.model.features == one.model.features
    whole.step(40)
    one.step(40)
    assert one.stepper.scratch.near.builds.numpy()[0] >= 2
    np.testing.assert_array_equal(one.state.position.numpy(), whole.state.position.numpy())
    np.testing.assert_array_equal(one.readout.contact_load.numpy(), whole.readout.contact_load.numpy())


def test_it_reports_speed_and_kernels(device):
    """A short run: three tables, and numbers that a program can read."""
    section = crowd.measure(device, sizes=(COUNT,), profiled=COUNT, rounds=1, seconds=0.02)
    assert len(section.tables) == 3
    data = json.loads(json.dumps(section.json(), allow_nan=False))
    found = data["crowds"][0]
    assert found["count"] == COUNT
    assert found["ns"]["median"] > 0.0
    assert 0.05 < found["touching"] < 0.5
    assert 1.0 <= found["steps_per_list"] < 40.0
    kernels = data["kernels"]
    assert kernels["soft_step"]["launches_per_step"] == 1.0
    assert 0.0 < kernels["list_slots"]["launches_per_step"] < 1.0
    assert "soft_step" in section.markdown()
