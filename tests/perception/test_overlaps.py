"""Bodies that images put into each other are pushed apart before contact sees them."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.perception.overlaps import ALLOWED, MOST_LEFT, Overlaps
from otwarp.scene import Scene
from otwarp.scene.transforms import rotate
from otwarp.simulation import Simulation


def deepest(sim: Simulation, position: np.ndarray, orientation: np.ndarray) -> float:
    """Largest overlap of spheres of two bodies over the smaller radius."""
    sim.set_state(position=position, orientation=orientation)
    places, turns = sim.prim_poses()
    spheres = [
        [(places[0, n] + rotate(turns[0, n], np.array(s.offset)), s.radius) for s in body.spheres if s.collides]
        for n, body in enumerate(sim.scene.bodies)
    ]
    found = 0.0
    for a, own in enumerate(spheres):
        for others in spheres[a + 1 :]:
            for p, r in own:
                for q, t in others:
                    found = max(found, (r + t - float(np.linalg.norm(p - q))) / min(r, t))
    return found


@pytest.mark.thorough
def test_a_cell_is_pushed_out_of_the_robots_that_hold_it():
    """Robots that are seen nearer together than the cell between them has room for, with the cell off its middle."""
    scene = Scene.load("scenes/cell_delivery.usda")
    sim = Simulation(scene, device="cpu")
    place, turn = sim.state.position.numpy()[0].astype(float), sim.state.orientation.numpy()[0].astype(float)
    overlaps = Overlaps(scene, np.asarray(sim.model.reference, dtype=float), [0, 1, 2])
    assert overlaps.part(place.copy(), turn, {0, 1, 2})[0] == 0
    robots = place[:2].copy()
    place[2] += (0.9, 0.2, 0.3)
    assert deepest(sim, place, turn) > 0.5
    assert overlaps.part(place, turn, {0, 1})[0] == 1
    assert np.array_equal(place[:2], robots)
    assert deepest(sim, place, turn) < 1.5 * ALLOWED
    sim.step(50)  # would stop at an overlap of half a radius


@pytest.mark.thorough
def test_a_second_robot_is_pushed_out_of_the_first():
    scene = Scene.load("scenes/cell_delivery.usda")
    sim = Simulation(scene, device="cpu")
    place, turn = sim.state.position.numpy()[0].astype(float), sim.state.orientation.numpy()[0].astype(float)
    overlaps = Overlaps(scene, np.asarray(sim.model.reference, dtype=float), [0, 1])
    place[2] += (0.0, 0.0, 20.0)
    place[1] = place[0] + (4.5, 0.0, 0.0)
    first = place[0].copy()
    assert overlaps.part(place, turn, {0, 1})[0] == 1 and np.array_equal(place[0], first)
    assert deepest(sim, place, turn) < 1.5 * ALLOWED


@pytest.mark.thorough
def test_no_room_is_said():
    """Robots so near together that the cell between them fits nowhere near: the largest overlap that is left."""
    scene = Scene.load("scenes/cell_delivery.usda")
    sim = Simulation(scene, device="cpu")
    place, turn = sim.state.position.numpy()[0].astype(float), sim.state.orientation.numpy()[0].astype(float)
    overlaps = Overlaps(scene, np.asarray(sim.model.reference, dtype=float), [0, 1, 2])
    place[0, 0] += 0.5
    place[1, 0] -= 0.5
    _, left = overlaps.part(place, turn, {0, 1})
    assert left == pytest.approx(deepest(sim, place, turn), rel=1e-3) and left > MOST_LEFT
