"""Which traps and bodies of a scene the topics mean, and what touches what."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.haptics.core.realtime import VirtualClock
from otwarp.ros.contract import UPRIGHT
from otwarp.ros.roles import Roles, surface_distance
from otwarp.scene import Obstacle, Scene, Track
from otwarp.teleop.session.live import LiveLoop
from tests.ros.setups import RATE, roles_of, run
from tests.teleop.scenes import three_beads

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@pytest.mark.thorough
def test_the_roles_of_the_cell_delivery():
    scene = Scene.load(SCENES / "cell_delivery.usda")
    clock = VirtualClock()
    loop = LiveLoop(scene, clock=clock, rate=RATE, device="cpu")
    roles = roles_of(loop)
    names = [scene.bodies[b].name for b in roles.robots]
    assert [name.rsplit("/", 1)[-1] for name in names] == ["left", "right"]
    assert roles.cell is not None and scene.bodies[roles.cell].kind == "cell"
    assert roles_of(loop, "older").groups == roles.groups[::-1]
    assert all(o.position.animated for o in roles.obstacles) and 1 <= len(roles.obstacles) <= 4
    loop.start()
    live = run(loop, clock, 0.2)
    state = roles.state(live)
    assert state.cell == pytest.approx(tuple(live.frame.position[0, roles.cell]))
    assert state.contact_force == pytest.approx(float(live.frame.contact_load[0, roles.cell]))
    assert state.cell_lost is False and state.collision is False and len(state.hits) == len(roles.obstacles)
    # put the first obstacle where the cell is: it is hit, by as much as presses on the cell or a robot
    there = Track.constant(state.cell)
    at_cell = replace(roles, obstacles=(replace(roles.obstacles[0], position=there), *roles.obstacles[1:]))
    now = at_cell.state(live)
    assert now.hits[0][0] and now.hits[0][1] == pytest.approx(live.frame.contact_load[0].max(), rel=1e-6)
    far = replace(live, frame=replace(live.frame, position=live.frame.position + 0.0))
    far.frame.position[0, roles.cell] += 500.0
    assert roles.state(far).cell_lost
    loop.close()


def test_a_scene_without_two_hands_is_refused():
    scene = three_beads()
    one = replace(scene, traps=scene.traps[1:])
    with pytest.raises(InputError, match="no trap of the left hand has ot:trap:hand = 'left'; allowed: two hands"):
        Roles.of(one, [(0, 0), (1, 0)])
    with pytest.raises(InputError, match="no trap of the left hand holds a sphere"):
        Roles.of(scene, [(-1, -1), (0, 0), (1, 0)])


@pytest.mark.parametrize(
    ("shape", "size", "points", "gaps"),
    [
        ("sphere", (2.0, 0.0, 0.0), [(3.0, 0.0, 0.0), (0.0, 0.0, 0.0)], [1.0, -2.0]),
        ("box", (1.0, 2.0, 3.0), [(4.0, 6.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 5.0)], [5.0, -0.5, 2.0]),
        ("cylinder", (1.0, 2.0, 0.0), [(4.0, 0.0, 6.0), (0.0, 0.0, 1.5), (0.0, 3.0, 0.0)], [5.0, -0.5, 2.0]),
        ("capsule", (1.0, 2.0, 0.0), [(0.0, 0.0, 5.0), (0.0, 3.0, 1.0), (0.0, 0.0, 0.0)], [2.0, 2.0, -1.0]),
        ("plane", (0.0, 0.0, 0.0), [(9.0, 9.0, 2.0), (0.0, 0.0, -1.0)], [2.0, -1.0]),
    ],
)
def test_distances_from_shapes(shape, size, points, gaps):
    obstacle = Obstacle(
        prim="/o", shape=shape, size=size, position=Track.constant((0.0,) * 3), orientation=Track.constant(UPRIGHT)
    )
    assert surface_distance(obstacle, ((0.0, 0.0, 0.0), UPRIGHT), np.array(points)) == pytest.approx(gaps)
    # a quarter turn about x: the shape's z is the world's −y
    quarter = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    moved = [(x + 1.0, 2.0 - z, 3.0 + y) for x, y, z in points]
    assert surface_distance(obstacle, ((1.0, 2.0, 3.0), quarter), np.array(moved)) == pytest.approx(gaps)
