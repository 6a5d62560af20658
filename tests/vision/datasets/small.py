"""A data set that renders in about a second: three tilts of a small robot, with few source points."""

from __future__ import annotations

from pathlib import Path

TEXT = """
seed = 3
poses = 1

[[sphere]]
center = [-0.8, 0, 0]
radius = 0.6

[[sphere]]
center = [0.7, 0, 0]
radius = 0.4

[image]
width = 32

[tilts]
classes = [0, 40, 90]
between = 1

[depth]
from = -2
to = 2
count = 12
between_count = 6

[optics]
numerical_aperture = 1.0
condenser_aperture = 0.3
pixel = 0.13

[render]
rings = 1
margin = 1
thickness = 0.2

[domain]
x = { from = -0.2, to = 0.2 }
brightness = { from = 0.3, to = 0.4 }

[splits]
random = [6, 3, 3]
focus_blocks = { blocks = 4, gap = 1 }
unseen_tilts = true
"""


def written(folder: Path, text: str = TEXT) -> Path:
    """The file in a folder."""
    file = folder / "small.toml"
    file.write_text(text, encoding="utf-8")
    return file
