"""A robot of one sphere pushes a cell across a shallow chamber: nothing holds the cell.

Sphere pushes sphere on one point, which is unstable: a cell that is off the line of the push by the angle a rolls
away at the rate v/(r + R)·sin a, within the 5.5 µm of both radii. The chamber is little higher than the cell, so that
it can only escape to the sides, and a hand that steers can bring it back. At the trap's SPEED_LIMIT the cell's drag
and the robot's own stay below what the trap holds: what fails here is the steering, not the trap.
"""

from __future__ import annotations

from otwarp.scene import Goal, SceneBuilder, Settings
from scenes.author import cells, one_sphere, shapes

CELL_RADIUS = 3.0
CHAMBER = 7.0  # from floor to lid [µm]
HEIGHT = CHAMBER / 2
POWER = 3.0  # [mW]
SPEED_LIMIT = 25.0  # of the trap [µm/s]
CELL_AT, ROBOT_AT, GOAL_AT = (-10.0, 0.0), (-18.0, 0.0), (20.0, 0.0)
HALF_X, HALF_Y, WALL_THICKNESS = 40.0, 26.0, 3.0
TOLERANCE, LOST_DISTANCE, CELL_LOST_DISTANCE, DISTANCE_WARNING = 2.0, 3.2, 20.0, 2.0
DURATION = 20.0  # [s]


def build() -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (0.0, -58.0, 58.0), (0.0, -3.0, 1.0), field_of_view=66.0)
    builder.add(one_sphere.robot((*ROBOT_AT, HEIGHT)), color=shapes.WARM_ROBOT)
    cell = cells.cell("/World/cell", CELL_RADIUS, position=(*CELL_AT, HEIGHT))
    builder.add(cell, color=shapes.PINK_CELL, opacity=0.7)
    builder.add(
        one_sphere.trap((*ROBOT_AT, HEIGHT), POWER, speed_limit=SPEED_LIMIT), color=shapes.RED_BEAM, opacity=0.45
    )
    builder.add(shapes.plane("/World/Chamber/floor", (0.0, 0.0, 0.0)), color=shapes.DEEP_BLUE)
    lid = shapes.plane("/World/Chamber/lid", (0.0, 0.0, CHAMBER), orientation=shapes.DOWNWARDS)
    builder.add(lid, color=shapes.GLASS, opacity=0.05)
    for wall in shapes.walls(
        "/World/Chamber/wall", half_x=HALF_X, half_y=HALF_Y, height=CHAMBER, thickness=WALL_THICKNESS
    ):
        builder.add(wall, color=shapes.GLASS, opacity=0.2)
    goal = Goal(
        prim="/World/goal",
        position=(*GOAL_AT, HEIGHT),
        cell=cell.prim,
        robots=(one_sphere.ROBOT,),
        tolerance=TOLERANCE,
        lost_distance=LOST_DISTANCE,
        cell_lost_distance=CELL_LOST_DISTANCE,
        distance_warning=DISTANCE_WARNING,
    )
    builder.add(goal, color=shapes.GREEN_GOAL, opacity=0.3)
    shapes.watched(builder, focus=HEIGHT, frame=(86.0, 58.0), color=shapes.GLASS)
    return builder
