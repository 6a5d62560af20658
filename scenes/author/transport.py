"""One bead of radius 0.5 µm in one tabulated trap that moves straight on, far from walls.

What studies of the largest speed start from: they play the path faster or slower. It is so long that no trial of a
fifth of a second comes to its end.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from otwarp.scene import SceneBuilder, Settings, Track
from scenes.author import shapes, table_trap

LENGTH = 2_000.0  # of the path [µm]
SPEED = 100.0  # [µm/s]


def build() -> SceneBuilder:
    height = table_trap.HEIGHT
    builder = SceneBuilder(settings=Settings(duration=LENGTH / SPEED, frames_per_second=60.0))
    builder.add_view("/World/view", (0.0, -14.0, height + 6.0), (0.0, 0.0, height), field_of_view=36.0)
    path = Track(times=np.array([0.0, LENGTH / SPEED]), values=np.array([[0.0, 0.0, height], [LENGTH, 0.0, height]]))
    bead = shapes.bead("/World/bead", (0.0, 0.0, height), radius=table_trap.RADIUS)
    builder.add(bead, color=shapes.WARM_ROBOT)
    builder.add(dataclasses.replace(table_trap.trap(), position=path), color=shapes.RED_BEAM, opacity=0.25)
    shapes.observed(builder, focus=height)
    return builder
