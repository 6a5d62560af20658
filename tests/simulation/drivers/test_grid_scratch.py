"""Memory of the grid driver: no more elements than int32 numbers."""

import pytest

from otwarp.errors import InputError
from otwarp.kernels.core.features import Features
from otwarp.simulation.drivers.grid_scratch import check_numbers


def test_links_and_lists_are_numbered_by_int32():
    """24 places of a list, or 48 of the links of shared entries, for each sphere; walls alone have entries, too."""
    listed = Features(driver="grid", pairs=True)
    check_numbers(listed, 1, 89_478_485)
    with pytest.raises(InputError, match="worlds is 1 with 89478486 spheres that collide in each; allowed: 89478485 "):
        check_numbers(listed, 1, 89_478_486)
    for shared in (
        Features(driver="grid", pairs=True, by_world=True),
        Features(driver="grid", obstacles=("plane",), by_world=True),
    ):
        check_numbers(shared, 87_381, 512)
        with pytest.raises(InputError, match=r"worlds is 87382 with 512 spheres .* allowed: 44739242 such spheres"):
            check_numbers(shared, 87_382, 512)
