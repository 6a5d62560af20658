"""The tutorials: every block runs, in its order, and makes the pictures beside it."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from docs.building.blocks import BLOCK, LARGEST, PAGES, PICTURES, pictures, run_page
from tests.documents import ROOT, Document

NEEDS = {"training": "torch", "chamber": "trimesh", "live": "rosbags", "closed_loop": "xarray"}
every_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


@pytest.mark.quick
@every_page
def test_a_tutorial_shows_what_its_code_makes(page: Path):
    made = "".join(code for language, code in BLOCK.findall(page.read_text()) if language in ("python", "bash"))
    assert pictures(page) and made
    for name in pictures(page):
        assert name in made or name.removesuffix(".png") + "." in made, name
        assert (PICTURES / name).stat().st_size <= LARGEST
    assert page.name == "start.md" or f"tutorials/{page.name}" in Document(ROOT / "docs" / "tutorials.md").links()


@every_page
def test_a_tutorial_runs(page: Path, tmp_path: Path):
    if page.stem in NEEDS:
        pytest.importorskip(NEEDS[page.stem])
    run_page(page, tmp_path)
    for name in pictures(page):
        with Image.open(tmp_path / name) as picture:
            assert min(picture.size) >= 200, name
