"""A robot held by three traps while two hundred cells drift past it, and past pillars, in a Poiseuille flow.

The channel is periodic: what leaves it on the right comes back on the left, so that it runs for as long as one likes.
The background flow is that between two plates and does not turn aside for the pillars. In mid-channel its drag on the
robot, 6πη·3.5 µm·SPEED, stays far below what the three traps can hold.
"""

from __future__ import annotations

import numpy as np

from otwarp.scene import Flow, SceneBuilder, Settings
from scenes.author import cells, robots, shapes

CELL_COUNT, CELL_RADIUS = 200, 3.0
SPEED = 40.0  # of the flow in mid-channel [µm/s]
HALF_X, HALF_Y, HALF_HEIGHT = 98.0, 45.0, 12.0
PILLARS = ((-62.0, 17.0, 8.0), (-24.0, -20.0, 8.0), (42.0, 20.0, 9.0), (70.0, -18.0, 7.0))  # x, y, radius [µm]
ROBOT_AT = (20.0, 0.0)
POWER = 5.0  # per trap [mW]
GAP = 0.4
WALL_THICKNESS = 4.0
BEYOND = 16.0  # how far the walls go on, so that a body at the end of the period meets no end of a wall [µm]
DURATION = 2.0


def cell_centres() -> np.ndarray:
    """(CELL_COUNT, 3) centres [µm]: clear of plates, walls, pillars, robot and each other."""
    margin = CELL_RADIUS + GAP
    low = np.array([-HALF_X + margin, -HALF_Y + margin, margin])
    high = np.array([HALF_X - margin, HALF_Y - margin, 2 * HALF_HEIGHT - margin])
    pillars = [(x, y, np.nan, radius + margin) for x, y, radius in PILLARS]
    robot = (*ROBOT_AT, HALF_HEIGHT, 9.0 + margin)
    return cells.scatter(
        CELL_COUNT, low, high, gap=2 * CELL_RADIUS + GAP, seed=11, keep_off=np.array([*pillars, robot])
    )


def build() -> SceneBuilder:
    settings = Settings(duration=DURATION, frames_per_second=60.0, period=(2 * HALF_X, 0.0, 0.0))
    builder = SceneBuilder(settings=settings)
    builder.add_view("/World/view", (0.0, -150.0, 125.0), (0.0, -10.0, 2.0), field_of_view=60.0)
    builder.add(
        Flow(prim="/World/flow", kind="poiseuille", origin=(0, 0, HALF_HEIGHT), speed=SPEED, half_height=HALF_HEIGHT)
    )
    robot = robots.five_element_robot("/World/robot", (*ROBOT_AT, HALF_HEIGHT), facing=-1)
    robots.add_robot(builder, robot, color=shapes.WARM_ROBOT)
    for trap in robots.traps_on(robot, "/World/Traps/left", power=POWER, hand="left"):
        builder.add(trap, color=shapes.RED_BEAM, opacity=0.45)
    prototype = cells.cell("/World/Cells", CELL_RADIUS)
    builder.add_cells("/World/Cells", prototype, cell_centres(), color=shapes.PINK_CELL, opacity=0.9)
    builder.add(shapes.plane("/World/Channel/floor", (0.0, 0.0, 0.0)), color=shapes.DEEP_BLUE)
    lid = shapes.plane("/World/Channel/lid", (0.0, 0.0, 2 * HALF_HEIGHT), orientation=shapes.DOWNWARDS)
    builder.add(lid, color=shapes.GLASS, opacity=0.05)
    for name, side in (("south", -1.0), ("north", 1.0)):
        middle = (0.0, side * (HALF_Y + WALL_THICKNESS / 2), HALF_HEIGHT)
        wall = shapes.box(f"/World/Channel/wall_{name}", middle, (HALF_X + BEYOND, WALL_THICKNESS / 2, HALF_HEIGHT))
        builder.add(wall, color=shapes.GLASS, opacity=0.2)
    for i, (x, y, radius) in enumerate(PILLARS, start=1):
        post = shapes.pillar(f"/World/Obstacles/pillar_{i}", x, y, radius=radius, height=2 * HALF_HEIGHT)
        builder.add(post, color=shapes.PILLAR)
    shapes.observed(builder, focus=HALF_HEIGHT)
    return builder
