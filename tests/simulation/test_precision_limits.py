"""Where there is no float64: each refusal names the true reason."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import bead_scene, harmonic, neutral, obstacle, sphere_body


def crowd() -> Scene:
    return Scene(bodies=tuple(neutral(f"B{i}", (5.0 * i, 0.0, 0.0)) for i in range(25)))


def ghosts(**more) -> Scene:
    """25 beads that do not touch each other, one of them in a trap."""
    beads = tuple(sphere_body(f"B{i}", (5.0 * i, 0.0, 0.0)) for i in range(25))
    return Scene(bodies=beads, traps=(harmonic("T", (0.0, 0.0, 0.0), cutoff=1.0, **more),))


def above_a_floor() -> Scene:
    """24 of the beads, and one that the floor stops."""
    bodies = (neutral("Heavy", (0.0, 0.0, 2.0)), *ghosts().bodies[1:])
    return Scene(bodies=bodies, obstacles=(obstacle("Floor", "plane", (0.0, 0.0, 0.0)),))


def meshed() -> Scene:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    mesh = dataclasses.replace(obstacle("Mesh", "mesh", (9.0, 0, 0)), vertices=corners, triangles=faces)
    return Scene(bodies=(neutral("B", (0.0, 0.0, 0.0)),), obstacles=(mesh,))


@pytest.mark.parametrize(
    ("scene", "more", "message"),
    [
        (bead_scene(), {"precision": "float16"}, "precision is 'float16'; allowed: float32, float64"),
        (crowd(), {}, r"allowed: float32 in a scene of 25 bodies that can touch each other, float64 in .* up to 24$"),
        (ghosts(speed_limit=5.0), {}, r"allowed: float32 in a scene of 25 bodies with a trap speed limit, float64"),
        (above_a_floor(), {}, r"allowed: float32 in a scene of 25 bodies that can touch obstacles, float64"),
        (meshed(), {}, r"/World/Mesh: precision is 'float64'; allowed: float32 with an obstacle that is a mesh"),
        (bead_scene(), {"fast_math": True}, "precision is 'float64' with fast_math; allowed: one of the two"),
    ],
    ids=("unknown", "crowd", "speed limit", "floor", "mesh", "fast math"),
)
def test_refused_where_there_is_none(scene, more, message, device):
    with pytest.raises(InputError, match=message) as error:
        Simulation(scene, device=device, **{"precision": "float64"} | more)
    assert "\n" not in str(error.value)
