"""Rotations as quaternions and as matrices, and what a transform is made of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.scene.transforms import decompose, quaternions, rotation_matrix

ROUNDING = 1e-12
"""Relative error of a few float64 operations."""


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_quaternion_and_matrix_agree(values: list[float]) -> None:
    q = np.array(values) / np.linalg.norm(values)
    matrix = rotation_matrix(q)
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=ROUNDING)
    found = quaternions(matrix[None])[0]
    assert min(np.abs(found - q).max(), np.abs(found + q).max()) < ROUNDING
    full = np.eye(4)
    full[:3, :3] = np.diag([-2.0, 3.0, 5.0]) @ matrix.T
    _, rotation, scale, shear = decompose(full[None])
    back = np.diag(scale[0]) @ rotation_matrix(rotation[0]).T
    assert back == pytest.approx(full[:3, :3], abs=10 * ROUNDING)
    assert shear[0] < ROUNDING
