"""Every notebook is one, is listed, and its cells run in their order in an empty folder and draw figures."""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.building.gallery import run_notebook
from tests.documents import ROOT, Document

jupytext = pytest.importorskip("jupytext", reason="pip install 'otwarp[docs]'")
pytest.importorskip("zarr", reason="pip install 'otwarp[studies]'")

NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.py"))
every_notebook = pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)


@every_notebook
def test_a_notebook_is_text_and_code_and_listed(file: Path):
    cells = jupytext.read(file, fmt="py:percent").cells
    kinds = [cell.cell_type for cell in cells]
    assert kinds[0] == "markdown" and cells[0].source.startswith("# ")
    assert kinds.count("code") >= 4 and kinds.count("markdown") >= 4
    assert f"notebooks/{file.name}" in Document(ROOT / "examples" / "README.md").links()


@every_notebook
def test_a_notebook_runs(file: Path, tmp_path: Path, monkeypatch):
    """In this process and not in a kernel of Jupyter, which tests need not install; what cells assert is checked."""
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    monkeypatch.chdir(tmp_path)
    run_notebook(file)
    assert len(plt.get_fignums()) >= 1
    for number in plt.get_fignums():
        plt.figure(number).savefig(tmp_path / f"{number}.png")
        assert all(axis.has_data() for axis in plt.figure(number).axes)
    plt.close("all")
    assert "assert " in file.read_text(), "a notebook checks what it says"
