"""The data sets that differ in one thing from what a network has learnt."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.vision_shifted import RANDOMISED, SHIFTS, changed
from otwarp.vision.datasets import labels_of, load_spec


@pytest.mark.parametrize("name", SHIFTS)
def test_a_shift_changes_what_it_says_and_no_more(tmp_path: Path, name: str) -> None:
    usual = labels_of(load_spec(changed(tmp_path, "usual", {}, count="8", scattered="true")))
    other = labels_of(load_spec(changed(tmp_path, "other", SHIFTS[name], count="8", scattered="true")))
    differ = {k for k in usual.arrays if not np.array_equal(usual.arrays[k], other.arrays[k])}
    assert differ <= set(SHIFTS[name]) and other.count == 80
    assert set(SHIFTS[name]) <= set(other.arrays)


def test_varied_optics_are_drawn_for_every_pose(tmp_path: Path) -> None:
    labels = labels_of(load_spec(changed(tmp_path, "varied", RANDOMISED)))
    assert len(np.unique(labels.arrays["wavelength"])) == 10
