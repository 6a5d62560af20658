"""Ten thousand cells of radius 3 to 4 µm in a closed chamber: a scene to measure neighbour search with."""

from __future__ import annotations

import numpy as np

from otwarp.scene import SceneBuilder, Settings
from scenes.author import cells, shapes

COUNTS = (50, 40, 5)
RADII = (3.0, 3.5, 4.0)  # of the cells in turn [µm]
COLORS = (shapes.PINK_CELL, (0.80, 0.12, 0.30), (0.70, 0.08, 0.34))
GAP = 0.2  # least gap between two cells at the start [µm]
JITTER = 1.0
WALL_THICKNESS = 5.0
DURATION = 1.0


def build() -> SceneBuilder:
    spacing = 2 * max(RADII) + 2 * JITTER + GAP
    half_x, half_y, height = (n * spacing / 2 + 1.0 for n in COUNTS)
    height *= 2
    points = cells.jittered_lattice(COUNTS, spacing, JITTER, seed=2) + np.array([0.0, 0.0, height / 2])
    kind = np.random.default_rng(3).permutation(len(points)) % len(RADII)
    builder = SceneBuilder(settings=Settings(duration=DURATION, frames_per_second=60.0))
    builder.add_view("/World/view", (-230.0, -520.0, 400.0), (-10.0, -45.0, 0.0), field_of_view=54.0)
    for i, (radius, color) in enumerate(zip(RADII, COLORS, strict=True)):
        prototype = cells.cell(f"/World/Cells/size_{i}", radius)
        builder.add_cells(f"/World/Cells/size_{i}", prototype, points[kind == i], color=color, opacity=1.0)
    builder.add(shapes.plane("/World/Channel/floor", (0.0, 0.0, 0.0)), color=shapes.DEEP_BLUE)
    lid = shapes.plane("/World/Channel/lid", (0.0, 0.0, height), orientation=shapes.DOWNWARDS)
    builder.add(lid, color=shapes.GLASS, opacity=0.05)
    sides = shapes.walls("/World/Channel/wall", half_x=half_x, half_y=half_y, height=height, thickness=WALL_THICKNESS)
    for wall in sides:
        builder.add(wall, color=shapes.GLASS, opacity=0.3)
    shapes.observed(builder, focus=height / 2)
    return builder
