"""Scenes with other values than their file's, read from one stage by several threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from otwarp.scene.read.variations import Variations

SCENE = Path(__file__).parents[3] / "scenes" / "single_bead.usda"


@pytest.mark.thorough
def test_threads_that_share_a_stage_get_the_values_that_they_ask_for():
    """As the devices of a study do, each with another point; without turns one in some has the other's radius."""
    variations = Variations(SCENE)
    radii = [0.5 + 0.01 * n for n in range(60)]
    with ThreadPoolExecutor(4) as pool:
        scenes = list(pool.map(lambda radius: variations.scene({"/World/bead/sphere.radius": radius}), radii))
    assert [scene.bodies[0].spheres[0].radius for scene in scenes] == radii
