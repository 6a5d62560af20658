"""A small scene to steer by hand: a robot for each hand, one cell, one pillar, a short channel.

The traps are at rest until a hand moves them, no faster than SPEED_LIMIT: about the speed at which the drag on a
robot reaches a third of what its traps can hold.
"""

from __future__ import annotations

from otwarp.scene import Goal, SceneBuilder, Settings
from scenes.author import cells, robots, shapes

HEIGHT = 8.0
CELL_RADIUS = 3.0
GAP = 3.0  # between the cell and each dish at the start [µm]
POWER = 5.0  # per trap [mW]
SPEED_LIMIT = 120.0  # of a trap [µm/s]
CELL_AT = (-14.0, -12.0)
GOAL_AT = (14.0, 14.0)
PILLAR = (4.0, 0.0, 6.0)  # x, y, radius [µm]
HALF_X, HALF_Y, WALL_HEIGHT, WALL_THICKNESS = 36.0, 28.0, 14.0, 3.0
DURATION = 10.0


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (0.0, -60.0, 56.0), (0.0, -3.0, 2.0), field_of_view=56.0)
    x, y = CELL_AT
    reach = robots.seat_distance(CELL_RADIUS) + GAP
    left = robots.five_element_robot("/World/Robots/left", (x - reach, y, HEIGHT), facing=1)
    right = robots.five_element_robot("/World/Robots/right", (x + reach, y, HEIGHT), facing=-1)
    cell = cells.cell("/World/cell", CELL_RADIUS, position=(x, y, HEIGHT))
    robots.add_robot(builder, left, color=shapes.WARM_ROBOT)
    robots.add_robot(builder, right, color=shapes.GOLD_ROBOT)
    builder.add(cell, color=shapes.PINK_CELL, opacity=0.7)
    for hand, robot, color in (("left", left, shapes.RED_BEAM), ("right", right, shapes.CYAN_BEAM)):
        for trap in robots.traps_on(robot, f"/World/Traps/{hand}", power=POWER, hand=hand, speed_limit=SPEED_LIMIT):
            builder.add(trap, color=color, opacity=0.45)
    builder.add(shapes.plane("/World/Channel/floor", (0.0, 0.0, 0.0)), color=shapes.DEEP_BLUE)
    for wall in shapes.walls(
        "/World/Channel/wall", half_x=HALF_X, half_y=HALF_Y, height=WALL_HEIGHT, thickness=WALL_THICKNESS
    ):
        builder.add(wall, color=shapes.GLASS, opacity=0.2)
    post = shapes.pillar("/World/Obstacles/pillar", PILLAR[0], PILLAR[1], radius=PILLAR[2], height=WALL_HEIGHT)
    builder.add(post, color=shapes.PILLAR)
    goal = Goal(
        prim="/World/goal",
        position=(*GOAL_AT, HEIGHT),
        cell=cell.prim,
        robots=(left.prim, right.prim),
        tolerance=2.0,
        lost_distance=3.0,
        cell_lost_distance=12.0,
        distance_warning=1.0,
    )
    builder.add(goal, color=shapes.GREEN_GOAL, opacity=0.3)
    shapes.watched(builder, focus=HEIGHT, frame=(78.0, 62.0))
    return builder
