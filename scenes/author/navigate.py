"""A robot of one sphere is led past pillars and swinging boxes to a goal, by one trap that can lose it.

Why these numbers. The trap pulls with 0.57·2.8 = 1.6 pN/mW at most, POWER times that before the sphere falls out of it,
which the drag 6πηr·v of the robot reaches at 57 µm/s: SPEED_LIMIT lets an operator go faster than the robot can follow.
At CRUISE it lags 1.7 µm behind the trap, for 50 ms. A straight line from start to goal meets the big pillar, and the
boxes close every way round it for part of the time.
"""

from __future__ import annotations

import numpy as np

from otwarp.scene import Body, Goal, Obstacle, SceneBuilder, Settings, Sphere, Track, Trap
from scenes.author import robots, shapes, trap_laws
from scenes.author.paths import swing

HEIGHT = 6.0  # of the robot's middle [µm]
RADIUS = 2.5  # of the robot [µm], for which the trap laws were fitted
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


def robot() -> Body:
    """A sphere of resist."""
    x, y = START
    sphere = Sphere(prim="/World/robot/sphere", radius=RADIUS, refractive_index=robots.RESIST_INDEX)
    return Body(
        prim="/World/robot",
        position=(x, y, HEIGHT),
        spheres=(sphere,),
        material=robots.RESIST,
        warning_force=10.0,
    )


def trap() -> Trap:
    """The trap, under the robot by what its light pushes."""
    x, y = START
    return Trap(
        prim="/World/trap",
        position=Track.constant((x, y, round(HEIGHT - trap_laws.EQUILIBRIUM, 6))),
        power=Track.constant(POWER),
        radial=trap_laws.RADIAL,
        axial=trap_laws.AXIAL,
        equilibrium=trap_laws.EQUILIBRIUM,
        hand="left",
        speed_limit=SPEED_LIMIT,
        holds="/World/robot/sphere",
    )


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
    builder.add(robot(), color=shapes.WARM_ROBOT)
    builder.add(trap(), color=shapes.RED_BEAM, opacity=0.45)
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
        cell="/World/robot",
        robots=("/World/robot",),
        tolerance=TOLERANCE,
        lost_distance=LOST_DISTANCE,
        cell_lost_distance=LOST_DISTANCE,
        distance_warning=DISTANCE_WARNING,
    )
    builder.add(goal, color=shapes.GREEN_GOAL, opacity=0.3)
    shapes.watched(builder, focus=HEIGHT, frame=(102.0, 60.0), color=shapes.GLASS)
    return builder
