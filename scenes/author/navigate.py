"""A robot of one sphere is led past pillars and swinging boxes to a goal, by one trap that can lose it.

Why these numbers. The trap pulls with 0.57·2.8 = 1.6 pN/mW at most, POWER times that before the sphere falls out of it,
which the drag 6πηr·v of the robot reaches at 57 µm/s: SPEED_LIMIT lets an operator go faster than the robot can follow.
At CRUISE it lags 1.7 µm behind the trap, for 50 ms. A straight line from start to goal meets the big pillar, and the
boxes close every way round it for part of the time.
"""

from __future__ import annotations

import numpy as np

from otwarp.scene import Goal, Obstacle, SceneBuilder, Settings
from scenes.author import one_sphere, shapes
from scenes.author.paths import swing

HEIGHT = 6.0  # of the robot's middle [µm]
POWER = 1.5  # [mW]
SPEED_LIMIT = 60.0  # of the trap [µm/s]
CRUISE = 35.0  # [µm/s]
START, GOAL = (-38.0, 0.0), (38.0, 0.0)
PILLARS = ((0.0, 0.0, 8.0), (-19.0, 16.0, 5.0), (20.0, -15.0, 5.0))  # x, y, radius [µm]
PILLAR_HEIGHT = 12.0
BOX_HALF = 3.0
BOXES = (  # middle (x, y), sway (x, y) [µm], period [s], phase [1]
    ((-14.0, -12.0), (0.0, 8.0), 4.0, 0.0),
    ((16.0, 13.0), (0.0, 8.0), 5.0, 0.3),
)
HALF_X, HALF_Y, WALL_HEIGHT, WALL_THICKNESS = 48.0, 27.0, 10.0, 3.0
TOLERANCE, LOST_DISTANCE, DISTANCE_WARNING = 3.0, 3.2, 2.5
DURATION = 10.0  # [s]


def boxes() -> list[Obstacle]:
    """The boxes, on tracks as long as the run."""
    items = []
    for i, ((x, y), (sway_x, sway_y), period, phase) in enumerate(BOXES, start=1):
        middle, sway = np.array([x, y, HEIGHT]), np.array([sway_x, sway_y, 0.0])
        track = swing(middle, sway, period=period, phase=phase, duration=DURATION)
        items.append(shapes.box(f"/World/Obstacles/box_{i}", track, (BOX_HALF, BOX_HALF, BOX_HALF)))
    return items


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (0.0, -72.0, 70.0), (0.0, -4.0, 2.0), field_of_view=64.0)
    builder.add(one_sphere.robot((*START, HEIGHT)), color=shapes.WARM_ROBOT)
    builder.add(one_sphere.trap((*START, HEIGHT), POWER, speed_limit=SPEED_LIMIT), color=shapes.RED_BEAM, opacity=0.45)
    builder.add(shapes.plane("/World/Channel/floor", (0.0, 0.0, 0.0)), color=shapes.DEEP_BLUE)
    for wall in shapes.walls(
        "/World/Channel/wall", half_x=HALF_X, half_y=HALF_Y, height=WALL_HEIGHT, thickness=WALL_THICKNESS
    ):
        builder.add(wall, color=shapes.GLASS, opacity=0.2)
    for i, (x, y, radius) in enumerate(PILLARS, start=1):
        post = shapes.pillar(f"/World/Obstacles/pillar_{i}", x, y, radius=radius, height=PILLAR_HEIGHT)
        builder.add(post, color=shapes.PILLAR)
    for item in boxes():
        builder.add(item, color=shapes.CUBE)
    goal = Goal(
        prim="/World/goal",
        position=(*GOAL, HEIGHT),
        cell=one_sphere.ROBOT,
        robots=(one_sphere.ROBOT,),
        tolerance=TOLERANCE,
        lost_distance=LOST_DISTANCE,
        cell_lost_distance=LOST_DISTANCE,
        distance_warning=DISTANCE_WARNING,
    )
    builder.add(goal, color=shapes.GREEN_GOAL, opacity=0.3)
    shapes.watched(builder, focus=HEIGHT, frame=(102.0, 60.0), color=shapes.GLASS)
    return builder
