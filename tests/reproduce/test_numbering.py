"""Figures and tables of the report by number: on its pages, in `docs/paper.md`, and to `--only`."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.reproduce.document import markdown
from otwarp.reproduce.numbering import FIGURES, TABLES, chosen, numbers_said
from otwarp.reproduce.registry import ITEMS
from otwarp.reproduce.runner import done_in, reproduce
from tests.documents import ROOT

OTHER_TITLE = re.compile(r"\*\*(?!Table \d+\. |What cannot)[^*]+\*\*")
"""A line of Markdown that is a title of a table without a number."""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with two items far apart, one of which has a figure, asked for by number."""
    out = tmp_path_factory.mktemp("numbered") / "paper"
    only = ["--only", "fig1", "--only", "Table 23"]
    assert main(["reproduce", "--out", str(out), "--quick", "--device", "cpu", *only]) == 0
    return out


def test_numbers_count_over_all_items_without_a_gap():
    for numbers in (FIGURES, TABLES):
        assert list(numbers) == list(ITEMS)
        counted = [n for own in numbers.values() for n in own]
        assert counted == list(range(1, len(counted) + 1))
    assert all(TABLES.values()), "every item sets the paper beside ours"
    assert numbers_said("delivery") == "figures 5 and 6, tables 12 and 13"
    assert numbers_said("setup") == "table 1" and numbers_said("contract") == "tables 22 and 23"


@pytest.mark.parametrize(
    ("word", "item"),
    [("fig1", "force_curves"), ("fig6", "delivery"), ("Figure 6", "delivery"), ("FIG. 9", "networks"),
     ("table1", "setup"), ("table2", "force_curves"), ("table_23", "contract"), ("rendering", "rendering")],
)  # fmt: skip
def test_a_number_means_the_item_that_it_is_in(word: str, item: str):
    assert [one.name for one in chosen([word])] == [item]


def test_items_come_in_the_reports_order_and_once():
    last, first = list(ITEMS)[-1], next(iter(ITEMS))
    assert [item.name for item in chosen([last, first, last, "table1", "fig5"])] == [first, "delivery", last]
    assert chosen([]) == list(ITEMS.values())


@pytest.mark.parametrize("word", ["fig0", "fig11", "table24", "fig6a", "fig", "6", "fig-", "fig" + "9" * 20])
def test_other_numbers_are_refused_with_those_there_are(word: str):
    with pytest.raises(InputError) as caught:
        chosen([word])
    said = str(caught.value)
    assert said.startswith(f"--only is {word}; allowed: setup, ") and "\n" not in said
    assert "not the paper's, fig1 to fig10 and table1 to table23" in said


@pytest.mark.thorough
def test_what_a_number_means_is_said(report: Path, capsys: pytest.CaptureFixture[str]):
    """It could be taken for a number of the paper."""
    assert main(["reproduce", "--out", str(report), "--quick", "--device", "cpu", "--only", "table4"]) == 0
    said = capsys.readouterr()
    assert "otwarp: table4 is of this report, not of the paper: in force_curves (Force curves and their" in said.err
    assert "Force curves and their fits: figure 1, tables 2 to 4 (" in said.out
    assert "force_curves is done" in said.err and "peak force on the hand [N]: paper 2.11 to 2.88, ours cl" in said.out


@pytest.mark.thorough
def test_the_page_numbers_what_is_there_and_says_what_is_not(report: Path):
    page = (report / "report.html").read_text(encoding="utf-8")
    assert '<figure id="fig1">' in page and "<b>Figure 1.</b> Force curves" in page
    shown = [*TABLES["force_curves"], *TABLES["contract"]]
    assert re.findall(r'<h3 id="table(\d+)">Table \1\. ', page) == [str(n) for n in shown]
    assert "--only delivery</code> computes figures 5 and 6, tables 12 and 13." in page
    assert "numbers of this report, which are not the paper's" in page


def test_the_list_says_the_numbers(capsys: pytest.CaptureFixture[str]):
    assert main(["reproduce", "--list"]) == 0
    assert re.search(r"^delivery +figures 5 and 6, tables 12 and 13 +contact force", capsys.readouterr().out, re.M)
    assert main(["reproduce", "--list", "--json"]) == 0
    delivery = json.loads(capsys.readouterr().out)["delivery"]
    assert (delivery["figures"], delivery["tables"]) == ([5, 6], [12, 13])


def labels(page: str) -> list[str]:
    """What is numbered in a page of Markdown, in its order."""
    return re.findall(r"^\*{1,2}((?:Figure|Table) \d+)\. ", page, re.M)


def expected(name: str) -> list[str]:
    """Of an item: its figures, the table of both, the others."""
    return [f"Figure {n}" for n in FIGURES[name]] + [f"Table {n}" for n in TABLES[name]]


@pytest.mark.thorough
def test_the_page_of_the_documents_has_the_same_numbers(report: Path):
    """That of a new report, and the committed one, which is of all items: the first lines are the same, too."""
    new = markdown(*done_in(report))
    assert labels(new) == [*expected("force_curves"), *expected("contract")]
    committed = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    assert labels(committed) == [label for name in ITEMS for label in expected(name)]
    assert not [line for page in (new, committed) for line in page.splitlines() if OTHER_TITLE.fullmatch(line)]
    head = new[: new.index("```\n\nEvery table")]
    assert "--only fig6" in head and committed.startswith(head)
    grades = next(line for line in new.splitlines() if line.startswith("How well"))
    assert grades in committed


def test_an_item_with_other_figures_than_it_declares_is_not_stored(tmp_path: Path, monkeypatch):
    """All later numbers would mean something else."""
    monkeypatch.setitem(ITEMS, "contract", replace(ITEMS["contract"], figures=1))
    with pytest.raises(AssertionError, match="numbers would shift"):
        reproduce(tmp_path, names=("contract",), quick=True, device="cpu")
    assert not list((tmp_path / "items").iterdir())
