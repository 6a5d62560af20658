"""Traps that are commanded velocities: the same as traps with samples along the same way."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.scene import Scene, Settings, Track
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import harmonic, line, obstacle, robot, sphere_body

VELOCITY = np.array([12.0, 0.0, 3.0])
"""Of all traps [µm/s]: too fast for what they hold."""
TIME, STEP, WORLDS = 0.2, 1e-3, 17
SETTINGS = Settings(time_step=STEP)


def one_bead() -> Scene:
    return Scene(bodies=(sphere_body("A"),), traps=(harmonic("T", power=0.3, cutoff=0.5),), settings=SETTINGS)


def two_traps() -> Scene:
    traps = tuple(harmonic(f"T{x:+g}", (x, 0.0, 0.8 * np.sign(x)), power=0.3, cutoff=0.5) for x in (-3.5, 3.5))
    return Scene(bodies=(robot("R", collides=False),), traps=traps, settings=SETTINGS)


def beads_on_a_floor() -> Scene:
    bodies = sphere_body("A", (0.0, 0.0, 1.1), collides=True), sphere_body("B", (4.0, 0.0, 1.1), collides=True)
    traps = (harmonic("T", (0.0, 0.0, 1.1), power=0.3, cutoff=0.5),)
    floor = obstacle("Floor", "plane", (0.0, 0.0, 0.0))
    return Scene(bodies=bodies, traps=traps, obstacles=(floor,), settings=SETTINGS)


SCENES = {"bead": one_bead, "robot": two_traps, "contact": beads_on_a_floor}


def on_the_way(scene: Scene) -> Scene:
    """The scene with samples of its traps along that way."""

    def way(track: Track) -> Track:
        start = track.at(0.0)
        return line((0.0, tuple(start)), (TIME, tuple(start + VELOCITY * TIME)))

    return dataclasses.replace(
        scene, traps=tuple(dataclasses.replace(trap, position=way(trap.position)) for trap in scene.traps)
    )


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "precision"),
    [
        ("bead", "float32"),
        pytest.param("bead", "float64", marks=pytest.mark.thorough),
        pytest.param("robot", "float32", marks=pytest.mark.thorough),
        pytest.param("contact", "float32", marks=pytest.mark.thorough),
    ],
)
def test_gliding_is_following_samples_along_the_same_way(name, precision, device):
    """Two launches, of which the second begins on the way; rounding makes the only difference."""
    scene = SCENES[name]()
    how = {"worlds": WORLDS, "seed": 3, "device": device, "precision": precision}
    sampled = Simulation(on_the_way(scene), **how)
    gliding = Simulation(scene, glides=True, **how)
    shape = gliding.control.trap_velocity.shape
    gliding.control.trap_velocity.assign(np.broadcast_to(VELOCITY, (*shape, 3)))
    for part in (0.3, 0.7):
        for sim in (sampled, gliding):
            sim.step(round(part * TIME / STEP))
    lost = [sim.last_readout.escape_step.numpy() for sim in (sampled, gliding)]
    assert np.all(lost[0].max(axis=1) >= 0) and np.abs(lost[0] - lost[1]).max() <= 1
    place = [sim.state.position.numpy() for sim in (sampled, gliding)]
    assert np.abs(place[0] - place[1]).max() < 2e-3
    foci = [sim.readout.trap_position.numpy() for sim in (sampled, gliding)]
    assert np.abs(foci[0] - foci[1]).max() < 1e-5


def test_a_trap_glides_from_where_it_is_told_to_since_when(device):
    sim = Simulation(one_bead(), device=device, glides=True)
    sim.step(10)
    sim.control.trap_position.assign([[[0.1, 0.0, 0.0]]])
    sim.control.trap_velocity.assign([[VELOCITY]])
    sim.control.trap_since.assign([sim.time])
    sim.step(20)
    assert sim.measure().trap_position.numpy()[0, 0] == pytest.approx([0.1, 0, 0] + 20 * STEP * VELOCITY, abs=1e-6)
