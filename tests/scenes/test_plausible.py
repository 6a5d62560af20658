"""Shipped scenes draw no warning."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.scene import Scene
from otwarp.scene.plausibility import judge

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.usda"))


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_shipped_scene_can_be_believed(path: Path) -> None:
    assert judge(Scene.load(path)) == ()
