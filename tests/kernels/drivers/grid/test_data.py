"""What the grid driver keeps of a contact."""

import pytest

from otwarp.kernels.core.features import Features
from otwarp.kernels.drivers.grid.data import whole_contacts


@pytest.mark.parametrize(("rigid", "walls"), [(False, 0), (True, 0), (False, 1), (True, 2)])
def test_lone_spheres_far_from_walls_keep_links(rigid, walls):
    """A force on them moves them along the normal alone, so that a link holds all of a contact."""
    assert whole_contacts(Features(driver="grid", rigid=rigid, walls=walls)) == (rigid or walls > 0)
