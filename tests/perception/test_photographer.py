"""Images of many worlds at once are those of each."""

from __future__ import annotations

import numpy as np

from otwarp.perception.camera import Region
from otwarp.perception.photographer import Photographer
from tests.perception.scenes import seen_bead


def test_worlds_are_recorded_as_each_alone(device: str):
    """One in the middle, one that its region cuts, one that is not in it; noise goes by the exposure's number."""
    photographer = Photographer(seen_bead(), device=device, seed=2)
    column, row = (side // 2 for side in photographer.size)
    position = np.array([[[0.0, 0.0, 0.0]], [[1.5, 0.3, 0.4]], [[9.0, 0.0, 0.0]]])
    orientation = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1, 1))
    regions, numbers = [Region(column - 16 + n, row - 12, 32, 24) for n in range(3)], [5, 7, 7]
    found = photographer.worlds(position, orientation, regions, numbers)
    assert found.shape == (3, 24, 32)
    for n in range(3):
        (piece,) = photographer.pieces(position[n][None], orientation[n][None], [regions[n]], numbers[n])
        # sums in another order on a GPU: a level at most
        np.testing.assert_allclose(found[n].astype(int), piece.levels, atol=0 if device == "cpu" else 1)
    assert np.ptp(found[0].astype(int)) > 3 * np.ptp(found[2].astype(int))
