from __future__ import annotations

from pathlib import Path

import pytest

from tests.view.runs import recorded


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a recorded run."""
    return recorded(tmp_path_factory.mktemp("view") / "first")


@pytest.fixture(scope="session")
def other(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the same scene, half as fast and shorter."""
    return recorded(tmp_path_factory.mktemp("view") / "second", count=90, speed=1.5)
