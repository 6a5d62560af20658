"""Every block of the pages runs, in its order; those of tutorials make the pictures beside them."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from docs.building.blocks import BLOCK, LARGEST, OTHERS, PAGES, PICTURES, pictures, run_page, runs
from tests.documents import ROOT, Document

NEEDS = {"training": "torch", "chamber": "trimesh", "live": "rosbags", "closed_loop": "xarray"}
NEEDS_OF_OTHERS = {
    "environments": "viser",
    "elsewhere": "trimesh",
    "networks": "onnxruntime",
    "recordings": "rosbags",
    "ros2": "cyclonedds",
    "teleop_page": "viser",
    "vision_data": "zarr",
}
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


@pytest.mark.parametrize("page", [p for p in OTHERS if runs(p)], ids=lambda page: page.stem)
def test_a_page_runs(page: Path, tmp_path: Path):
    if page.stem in NEEDS_OF_OTHERS:
        pytest.importorskip(NEEDS_OF_OTHERS[page.stem])
    run_page(page, tmp_path)


@pytest.mark.quick
def test_a_block_that_does_not_run_says_why(tmp_path: Path):
    page, folder, again = tmp_path / "page.md", tmp_path / "work", tmp_path / "again"
    folder.mkdir()
    again.mkdir()
    page.write_text("<!-- not run: needs a GPU -->\n```python\n1 / 0\n```\n\n```bash\ntouch made\n```\n")
    run_page(page, folder)
    assert (folder / "made").exists() and runs(page)
    page.write_text("<!-- not run: -->\n```python\n1 / 0\n```\n")
    with pytest.raises(ZeroDivisionError):
        run_page(page, again)
