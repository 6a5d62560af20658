"""Pages of the notebooks: text and code are the notebook's, and what it said and drew is there."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("jupytext", reason="pip install 'otwarp[docs]'")

from docs.building.gallery import LARGEST
from docs.building.notebooks import NOTEBOOKS, PAGES, PICTURES, page, run, without_output


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_page_has_its_notebook_as_it_is_now(file: Path):
    text = (PAGES / f"{file.stem}.md").read_text(encoding="utf-8")
    assert without_output(text) == page(file), f"python -m docs.building.notebooks {file.stem}"
    assert "```text\n" in text
    pictures = {path.name for path in PICTURES.glob(f"{file.stem}_*.png")}
    assert pictures and all(f"(../images/notebooks/{name})" in text for name in pictures)
    assert all((PICTURES / name).stat().st_size <= LARGEST for name in pictures)


def test_every_notebook_has_a_page():
    assert {path.stem for path in PAGES.glob("*.md")} == {file.stem for file in NOTEBOOKS}


def test_what_a_cell_says_and_draws_is_kept(tmp_path: Path):
    file = tmp_path / "small.py"
    file.write_text(
        "# %% [markdown]\n# # Small\n#\n# It counts.\n\n# %%\nprint('one ')\n1 + 1\n\n# %%\nx = None\nx\n\n"
        "# %%\nimport matplotlib.pyplot as plt\nplt.plot([0, 1])\n"
    )
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    said, drawn = run(file, tmp_path)
    assert said == ["one \n2\n", "", ""] and drawn == [[], [], ["small_1.png"]]
    assert (tmp_path / "small_1.png").stat().st_size > 1000
    text = page(file, said, drawn)
    assert "```text\none\n2\n```" in text and "![Drawn by this code: Small](../images/notebooks/small_1.png)" in text
    assert text.startswith("# Small\n\n[The notebook](") and without_output(text) == page(file)
