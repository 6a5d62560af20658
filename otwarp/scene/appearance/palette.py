"""Colours of what a scene does not give any, linear RGB as USD has it (deeper than they look on a screen)."""

from __future__ import annotations

from otwarp.scene.description import Body, Goal, Obstacle, Trap

Color = tuple[float, float, float]

ROBOTS: tuple[Color, ...] = (
    (0.90, 0.27, 0.04),
    (0.05, 0.38, 0.80),
    (0.93, 0.62, 0.06),
    (0.06, 0.50, 0.22),
    (0.48, 0.14, 0.66),
    (0.03, 0.60, 0.62),
)
"""Of the first, second … robot, and from the start again: neighbours differ in hue and in lightness."""

CELL: tuple[Color, float] = ((0.92, 0.20, 0.36), 0.7)
OBSTACLE: tuple[Color, float] = ((0.16, 0.20, 0.30), 1.0)
GROUND: tuple[Color, float] = ((0.010, 0.026, 0.085), 1.0)
"""Of planes that bound the liquid."""
GOAL: tuple[Color, float] = ((0.10, 0.85, 0.30), 0.3)
OTHER: tuple[Color, float] = ((0.55, 0.57, 0.60), 1.0)

BEAMS: dict[str, Color] = {"left": (1.0, 0.10, 0.07), "right": (0.03, 0.75, 1.0), "none": (1.0, 0.10, 0.07)}
"""Of the traps of the left hand, of the right one, and of those that no hand moves."""
BEAM_OPACITY = 0.25

DOME, KEY = 0.4, 1.6
"""Radiance of the dome, irradiance of the key light: a white surface that faces it has the radiance DOME + KEY/π = 0.9,
just below what a picture shows as white."""
DOME_COLOR: Color = (0.75, 0.85, 1.0)
KEY_COLOR: Color = (1.0, 0.96, 0.90)
KEY_DIRECTION = (0.45, 0.55, -1.0)


def robot_color(index: int) -> Color:
    """Colour of the robot of that index."""
    return ROBOTS[index % len(ROBOTS)]


def look_of(item: object, robots: int) -> tuple[Color, float]:
    """Colour and opacity of an item of a scene; `robots` is how many there are before it."""
    if isinstance(item, Trap):
        return BEAMS[item.hand], BEAM_OPACITY
    if isinstance(item, Body):
        return CELL if item.kind == "cell" else (robot_color(robots), 1.0)
    if isinstance(item, Obstacle):
        return GROUND if item.shape == "plane" else OBSTACLE
    return GOAL if isinstance(item, Goal) else OTHER
