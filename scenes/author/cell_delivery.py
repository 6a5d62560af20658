"""Two five-element robots carry a cell between their dishes past pillars and moving cubes: the paper's task.

Why these numbers. The cell is squeezed with PRELOAD, which the traps give by standing ahead of where they would hold
the robots at rest. A dish whose rim meets the cell at the angle a from its axis (sin a = ring radius/(cell radius +
ring sphere radius) = 0.38) holds about 2·PRELOAD·tan a sideways; the cell's drag is 6πηr·v. At CRUISE the drag is
well below that, at three times the speed above it: the dishes lose the cell. The pair must also not buckle: the traps'
stiffness against pitching has to exceed PRELOAD times the lever from the robot's centre to the cell, which fixes the
least power. One scene unit of the paper is about 25 µm here.
"""

from __future__ import annotations

import numpy as np

from otwarp.scene import Body, Goal, Obstacle, SceneBuilder, Settings, Track, Trap, Vec3
from scenes.author import cells, robots, shapes, trap_laws
from scenes.author.paths import curve_through, journey, swing

HEIGHT = 8.0  # of the robots' plane [µm]
CELL_RADIUS = 3.0
CELL_MODULUS = 1000.0  # [Pa]
POWER = 3.6  # per trap [mW]
PRELOAD = 2.2  # on the cell [pN]
CRUISE = 19.0  # [µm/s]
REST, RAMP, SETTLE = 0.5, 1.0, 1.0  # [s]
WAYPOINTS = (
    (-58.0, -26.0),
    (-55.0, 4.0),
    (-34.0, 22.0),
    (-10.0, 2.0),
    (8.0, -20.0),
    (36.0, -22.0),
    (52.0, 2.0),
    (56.0, 24.0),
)
PILLARS = ((-31.0, -9.0, 8.5), (26.0, 6.5, 10.0))  # x, y, radius [µm]
PILLAR_HEIGHT = 16.0
CUBE_HALF = 3.5
CUBES = (  # middle (x, y), sway (x, y) [µm], period [s], phase [1]
    ((-66.0, 33.0), (9.0, 0.0), 6.0, 0.00),
    ((-8.0, -26.0), (9.0, 0.0), 5.0, 0.25),
    ((8.0, 24.0), (0.0, 9.0), 7.0, 0.50),
    ((66.0, -26.0), (0.0, 12.0), 6.5, 0.10),
)
HALF_X, HALF_Y, WALL_HEIGHT, WALL_THICKNESS = 80.0, 41.0, 12.0, 3.0
TOLERANCE, LOST_DISTANCE, CELL_LOST_DISTANCE, DISTANCE_WARNING = 1.5, 3.0, 3.0, 1.0


def pair() -> tuple[Body, Body, Body]:
    """The left robot (facing +X), the right robot (facing −X) and the cell seated in both dishes."""
    x, y = WAYPOINTS[0]
    seat = robots.seat_distance(CELL_RADIUS)
    left = robots.five_element_robot("/World/Robots/left", (x - seat, y, HEIGHT), facing=1)
    right = robots.five_element_robot("/World/Robots/right", (x + seat, y, HEIGHT), facing=-1)
    cell = cells.cell("/World/cell", CELL_RADIUS, modulus=CELL_MODULUS, position=(x, y, HEIGHT))
    return left, right, cell


def path() -> Track:
    """Displacement of all six traps over time [µm]."""
    curve = curve_through(np.array([(x, y, HEIGHT) for x, y in WAYPOINTS]))
    return journey(curve, rest=REST, ramp=RAMP, cruise=CRUISE, settle=SETTLE)


def preload_shift() -> float:
    """How far the traps stand ahead of the robots at rest [µm]: PRELOAD over the stiffness of a robot's three traps."""
    radii = [robots.element_radius(element) for element in robots.HELD_ELEMENTS]
    return PRELOAD / sum(trap_laws.stiffness_of(trap_laws.RADIAL, r, POWER) for r in radii)


def traps() -> list[Trap]:
    """Six moving traps: the left hand leads the left robot, the right hand the right one."""
    left, right, _ = pair()
    shift, way = preload_shift(), path()
    ahead: Vec3 = (shift, 0.0, 0.0)
    behind: Vec3 = (-shift, 0.0, 0.0)
    return [
        *robots.traps_on(left, "/World/Traps/left", power=POWER, shift=ahead, path=way, hand="left"),
        *robots.traps_on(right, "/World/Traps/right", power=POWER, shift=behind, path=way, hand="right"),
    ]


def obstacles() -> dict[str, list[Obstacle]]:
    """Floor, walls, pillars and moving cubes, by the name of their look."""
    duration = float(path().times[-1])
    cubes = []
    for i, ((x, y), (sway_x, sway_y), period, phase) in enumerate(CUBES, start=1):
        middle, sway = np.array([x, y, HEIGHT]), np.array([sway_x, sway_y, 0.0])
        track = swing(middle, sway, period=period, phase=phase, duration=duration)
        cubes.append(shapes.box(f"/World/Obstacles/cube_{i}", track, (CUBE_HALF, CUBE_HALF, CUBE_HALF)))
    return {
        "floor": [shapes.plane("/World/Channel/floor", (0.0, 0.0, 0.0))],
        "wall": shapes.walls(
            "/World/Channel/wall", half_x=HALF_X, half_y=HALF_Y, height=WALL_HEIGHT, thickness=WALL_THICKNESS
        ),
        "pillar": [
            shapes.pillar(f"/World/Obstacles/pillar_{i}", x, y, radius=r, height=PILLAR_HEIGHT)
            for i, (x, y, r) in enumerate(PILLARS, start=1)
        ],
        "cube": cubes,
    }


def build() -> SceneBuilder:
    left, right, cell = pair()
    duration = float(path().times[-1])
    builder = SceneBuilder(settings=Settings(duration=duration, frames_per_second=60.0))
    builder.add_view("/World/view", (0.0, -118.0, 112.0), (0.0, -8.0, 2.0), field_of_view=57.0)
    builder.add_view("/World/closeup", (-60.0, -28.0, 42.0), (-36.0, 17.0, 6.0), field_of_view=42.0)
    robots.add_robot(builder, left, color=shapes.WARM_ROBOT)
    robots.add_robot(builder, right, color=shapes.GOLD_ROBOT)
    builder.add(cell, color=shapes.PINK_CELL, opacity=0.7)
    for trap in traps():
        builder.add(trap, color=shapes.RED_BEAM if trap.hand == "left" else shapes.CYAN_BEAM, opacity=0.45)
    looks = {
        "floor": (shapes.DEEP_BLUE, 1.0),
        "wall": (shapes.GLASS, 0.2),
        "pillar": (shapes.PILLAR, 1.0),
        "cube": (shapes.CUBE, 1.0),
    }
    for look, items in obstacles().items():
        for item in items:
            builder.add(item, color=looks[look][0], opacity=looks[look][1])
    x, y = WAYPOINTS[-1]
    goal = Goal(
        prim="/World/goal",
        position=(x, y, HEIGHT),
        cell=cell.prim,
        robots=(left.prim, right.prim),
        tolerance=TOLERANCE,
        lost_distance=LOST_DISTANCE,
        cell_lost_distance=CELL_LOST_DISTANCE,
        distance_warning=DISTANCE_WARNING,
    )
    builder.add(goal, color=shapes.GREEN_GOAL, opacity=0.3)
    shapes.watched(builder, focus=HEIGHT, frame=(170.0, 90.0), color=shapes.GLASS)
    return builder
