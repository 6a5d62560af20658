"""The gallery shows what the tables of examples and notebooks say, in pictures that are small."""

from __future__ import annotations

import numpy as np
from PIL import Image

from docs.building.blocks import keep
from docs.building.gallery import EXAMPLES, LARGEST, PAGE, PICTURES, page, rows


def test_every_notebook_and_example_that_does_not_train_is_in_the_gallery():
    names = {path.stem for path in EXAMPLES.rglob("*.py")} - {"__init__"}
    assert set(rows()) == {name for name in names if not name.startswith("train_")}
    assert PAGE.read_text() == page(), "python -m docs.building.gallery"
    assert {path.stem for path in PICTURES.iterdir()} == set(rows())
    for path in PICTURES.iterdir():
        assert path.stat().st_size <= LARGEST, path.name


def test_a_large_picture_is_made_small(tmp_path):
    noise = np.random.default_rng(1).integers(0, 255, (300, 600, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "large.png")
    keep(tmp_path / "large.png", tmp_path / "small.png", largest=40_000, widest=200)
    assert (tmp_path / "small.png").stat().st_size <= 40_000
    with Image.open(tmp_path / "small.png") as image:
        assert image.size == (200, 100)
