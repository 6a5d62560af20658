"""The pages of docs/validation: one for each test module, and a list of them that says nothing else than they do."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import validation
from benchmarks.validation import Collector
from otwarp.bench.machine import Machine
from otwarp.device import pick_device

TESTS = Path(validation.ROOT, "tests", "validation")


def found(*rows: tuple[str, float]) -> Collector:
    """Figures of tests/validation/test_x.py, by test and measured value; the law is 1 ± 0.1, its bias 0.05."""
    figures = {
        f"tests/validation/test_x.py::{name}": [
            {
                "quantity": "|a|",
                "count": 3,
                "measured": m,
                "expected": 1.0,
                "error": 0.1,
                "bias": 0.05,
                "sigmas": (m - 1.0) / 0.1,
            }
        ]
        for name, m in rows
    }
    return Collector(
        abouts=dict.fromkeys(figures, ("A law. Source: somebody 1905.", "What it is about.")), rows=figures
    )


def test_every_test_module_has_its_page():
    modules = {path.stem.removeprefix("test_") for path in TESTS.glob("test_*.py")} - {"laws"}
    pages = {path.stem for path in validation.PAGES.glob("*.md")} - {"weak_noise"}
    assert modules == pages


def test_the_short_page_lists_what_the_pages_hold():
    text = validation.SUMMARY.read_text()
    assert validation.put_on_page(text, validation.summary()) == text
    assert len(text.splitlines()) <= 120


def test_pages_are_written_for_files_that_ran_as_a_whole(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(validation, "PAGES", tmp_path)
    monkeypatch.setattr(validation, "SUMMARY", tmp_path / "list.txt")
    validation.SUMMARY.write_text(f"before {validation.BEGIN}{validation.END} after")
    results = found(("test_a", 1.2), ("test_a_precisely", 1.3))
    texts = validation.markdown(results, Machine.look(pick_device("cpu")), "command")
    validation.write_pages(texts, {"tests/validation/test_x.py"})
    assert not list(tmp_path.glob("*.md")) and "left as it was" in capsys.readouterr().err
    validation.write_pages(texts, set())
    page = (tmp_path / "x.md").read_text()
    assert "# X\n\nWhat it is about." in page and "*somebody 1905.*" in page
    assert "1.3" in page and "1.2" not in page  # the precise form stands for both
    (row,) = validation.printed_rows(page)
    assert validation.count(row) == 3 and validation.excess(row) == pytest.approx(2.5)


def test_the_list_counts_failures(tmp_path):
    results = found(("test_a", 1.9))
    results.failed = list(results.rows)
    (text,) = validation.markdown(results, Machine.look(pick_device("cpu")), "command").values()
    (tmp_path / "x.md").write_text(text)
    listed = validation.summary(tmp_path)
    assert "3 comparisons on 1 subjects: 1 tests fail; the farthest is 8.5 σ off" in listed
