"""What is said of a picture: bodies that its edge cuts."""

from __future__ import annotations

import pytest

from otwarp.errors import PlausibilityWarning
from otwarp.vision.moment import moments
from otwarp.vision.pictures import picture
from otwarp.vision.rendering import Rendering


@pytest.mark.quick
def test_bodies_that_the_edge_cuts_are_named() -> None:
    seen = moments("scenes/single_bead.usda")
    with pytest.warns(PlausibilityWarning, match="rings is 1, too few"):
        found = [picture(seen, size=size, rendering=Rendering(rings=1, thickness=0.5), device="cpu").cut
                 for size in ((24, 24), (48, 24), (48, 48))]  # fmt: skip
    assert found == [("/World/bead",), ("/World/bead",), ()]
