from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.scene import Scene
from tests.record.small_run import load


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return load(tmp_path / "scene")
