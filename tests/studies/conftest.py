"""A study of six blocks, and what one process finds, for tests of who computes it."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.cli.main import main
from otwarp.studies.store import open_store
from tests.studies.scenes import bead_in_a_well, study_of_a_well


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A study and its scene."""
    place = tmp_path_factory.mktemp("study")
    bead_in_a_well(place)
    (place / "s.toml").write_text(study_of_a_well(12, 2_048))
    return place


@pytest.fixture(scope="module")
def whole(folder):
    """What an undisturbed run of one process gives."""
    assert main(["study", "run", str(folder / "s.toml"), "--device", "cpu", "-o", str(folder / "whole")]) == 0
    return open_store(folder / "whole").read().load()
