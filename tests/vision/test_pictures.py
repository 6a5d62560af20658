"""What is said of a picture: bodies that its edge cuts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from otwarp.errors import PlausibilityWarning
from otwarp.vision.moment import moments
from otwarp.vision.pictures import picture
from otwarp.vision.rendering import Rendering
from otwarp.vision.stack import load_stack, save_stack


@pytest.mark.quick
def test_bodies_that_the_edge_cuts_are_named() -> None:
    seen = moments("scenes/single_bead.usda")
    with pytest.warns(PlausibilityWarning, match="rings is 1, too few"):
        found = [picture(seen, size=size, rendering=Rendering(rings=1, thickness=0.5), device="cpu").cut
                 for size in ((24, 24), (48, 24), (48, 48))]  # fmt: skip
    assert found == [("/World/bead",), ("/World/bead",), ()]


@pytest.mark.quick
@pytest.mark.parametrize("bits", [1, 8, 12])
def test_panels_are_white_at_full_scale(tmp_path: Path, bits: int) -> None:
    levels = np.zeros((1, 40, 40), dtype=np.uint8 if bits <= 8 else np.uint16)
    levels[:, :, 20:] = 2**bits - 1
    save_stack(tmp_path / "s.png", levels / levels.max(), levels, np.zeros(1), 0.1, bits)
    shown = np.array(Image.open(tmp_path / "s.png").convert("L")).astype(int)
    middle = shown[len(shown) // 2]
    assert (middle < 10).sum() > 100 and (middle > 245).sum() > 100
    save_stack(tmp_path / "s.tif", levels / levels.max(), levels, np.zeros(1), 0.1, bits)
    assert np.array_equal(load_stack(tmp_path / "s.tif"), levels)
