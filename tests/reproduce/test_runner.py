"""The command: items end to end, interruption, bad input."""

from __future__ import annotations

import csv
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.reproduce.code import Code
from otwarp.reproduce.document import markdown
from otwarp.reproduce.item import Result, Value, shown
from otwarp.reproduce.parts import Part, how_long
from otwarp.reproduce.registry import ITEMS
from otwarp.reproduce.report import plain, took
from otwarp.reproduce.runner import done_in, reproduce
from otwarp.reproduce.store import Done

CHEAP = ("setup", "contract")


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with two items, made by the command."""
    out = tmp_path_factory.mktemp("reproduce") / "paper"
    only = [word for name in CHEAP for word in ("--only", name)]
    assert main(["reproduce", "--out", str(out), "--quick", "--device", "cpu", *only]) == 0
    return out


def test_every_item_has_a_title_of_its_own_and_says_what_it_regenerates():
    assert list(ITEMS) == [item.name for item in ITEMS.values()]
    assert len({item.title for item in ITEMS.values()}) == len(ITEMS)
    assert all(item.about and re.fullmatch(r"[a-z_]+", item.name) for item in ITEMS.values())


def test_the_report_is_one_file_with_both_sides(report: Path):
    page = (report / "report.html").read_text(encoding="utf-8")
    for name in CHEAP:
        assert f'<section id="{name}">' in page
    assert "94755b031db2" in page and "Geomagic Touch" in page
    assert page.count('class="absent"') + page.count('"absent"') >= len(ITEMS) - len(CHEAP)
    assert not re.search(r'(src|href)="(?!data:|#)', page), "nothing is loaded from elsewhere"
    assert "<script" not in page


def test_numbers_are_there_for_programs(report: Path):
    numbers = json.loads((report / "numbers.json").read_text(encoding="utf-8"))
    assert numbers["quick"] is True and set(numbers["items"]) == set(CHEAP)
    (seconds,) = numbers["seconds"].values()
    assert seconds == pytest.approx(sum(item["seconds"] for item in numbers["items"].values()))
    with (report / "numbers.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["item"] for row in rows} == set(CHEAP)
    assert next(r for r in rows if r["what"] == "pixel")["ours_text"] == "0.065"


def of(one: Done, *rows: tuple[str, str, float], code: Code | None = None) -> Done:
    """An item as if computed in other parts: (call, machine, seconds) each."""
    code = code or one.code
    return replace(one, parts=tuple(Part(call=call, code=code, device="cpu", machine=machine, seconds=seconds)
                                    for call, machine, seconds in rows))  # fmt: skip


FIRST, LATER = "2026-01-02T03:04:05.678+00:00", "2026-01-02T03:15:00.000+00:00"


def test_times_are_told_by_machine(report: Path):
    """A machine's load differs from item to item, and does not make another of it."""
    page = (report / "report.html").read_text(encoding="utf-8")
    assert '<section id="times">' in page and f"{len(CHEAP)} of {len(ITEMS)} items" in page
    one, other = done_in(report)[1]
    here = [of(one, (FIRST, "card, load 0.2 at the start", 5.0)), of(other, (FIRST, "card, load 3 at the start", 7.0))]
    assert "wall time: 12 s on card. Computed in one call of the command, begun 2026-01-02 03:04 UTC." in took(here)
    here.append(of(one, (LATER, "core, load 1.5 at the start", 30.0)))
    assert "wall time: 42 s in all: 30 s on core; 12 s on card." in took(here)
    assert "in 2 calls of the command, the first begun 2026-01-02 03:04 UTC, the last 2026-01-02 03:15 UTC. No" in took(
        here
    )


def test_an_item_in_parts_says_so_with_the_time_of_all_of_them(report: Path):
    one, other = done_in(report)[1]
    cut = of(one, (FIRST, "card, load 0.2 at the start", 590.0), (LATER, "core, load 1 at the start", 32.0))
    assert cut.seconds == 622.0 and how_long(cut.parts) == "622 s in 2 parts (590, 32 s)"
    assert "622 s in all: 590 s on card; 32 s on core." in took([cut])
    assert f"so many parts: {one.title} (2); their times" in took([cut, other])
    store = done_in(report)[0]
    assert "*Computed in 622 s in 2 parts (590, 32 s) on card; core." in markdown(store, [cut])


def test_items_of_different_code_are_told_apart(report: Path):
    one, other = done_in(report)[1]
    a, b = (Code(commit=name, digest=name) for name in ("aaaaaaaa", "bbbbbbbb"))
    row = (FIRST, "card", 1.0)
    store = done_in(report)[0]
    assert "Code: commit aaaaaaaa, files aaaaaaaa" in markdown(store, [of(one, row, code=a), of(other, row, code=a)])
    page = markdown(store, [of(one, row, code=a), of(other, row, code=b)])
    assert f"not of one code: commit aaaaaaaa, files aaaaaaaa computed {one.title}; commit bbbbbbbb" in page


def test_items_that_are_done_are_kept(report: Path, capsys: pytest.CaptureFixture[str]):
    file = report / "items" / "setup" / "item.json"
    before = file.stat().st_mtime_ns
    assert main(["reproduce", "--out", str(report), "--quick", "--device", "cpu", "--only", "setup", "--json"]) == 0
    said = capsys.readouterr()
    assert "setup is done" in said.err
    assert set(json.loads(said.out)["seconds"]) == set(CHEAP)
    assert file.stat().st_mtime_ns == before


def test_an_item_reads_back_as_it_was_written(report: Path):
    _, done = done_in(report)
    said = json.loads((done[0].folder / "item.json").read_text(encoding="utf-8"))["result"]
    assert Result.read(said) == done[0].result
    assert json.loads(json.dumps(done[0].result.said())) == said


@pytest.mark.thorough
def test_an_interrupted_item_leaves_nothing_and_the_rest_goes_on(tmp_path: Path):
    def interrupt(line: str) -> None:
        if line.startswith("force_curves:"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce(tmp_path, names=("setup", "force_curves"), quick=True, device="cpu", say=interrupt)
    assert [p.name for p in (tmp_path / "items").iterdir()] == ["setup"]
    assert '<section id="setup">' in (tmp_path / "report.html").read_text(encoding="utf-8")
    before = (tmp_path / "items" / "setup" / "item.json").stat().st_mtime_ns
    found = reproduce(tmp_path, names=("setup", "contract"), quick=True, device="cpu")
    assert [one.name for one in found.done] == ["setup", "contract"] and not found.missing
    assert (tmp_path / "items" / "setup" / "item.json").stat().st_mtime_ns == before


def test_the_page_of_the_documents(report: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "images").mkdir()
    (tmp_path / "images" / "paper_gone.png").write_bytes(b"of an item that is gone")
    page = tmp_path / "paper.md"
    page.write_text("Two runs are in it, put together by hand.")
    assert main(["reproduce", "--out", str(report), "--docs", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert f"{len(CHEAP)} of {len(ITEMS)} items, one after the other, wall time: " in text
    assert "## The setup" in text and "| pixel [µm] | 0.065 | S | 0.065 |" in text
    assert not list((tmp_path / "images").iterdir())
    assert "by hand." not in text and "wrote" in capsys.readouterr().out


def test_the_page_of_a_report_that_cannot_be_written(report: Path, tmp_path: Path, monkeypatch):
    """A report that was brought from elsewhere may be read-only: a page is written of it, nothing in it."""
    (tmp_path / "images").mkdir()
    asked: list[Path] = []
    for place in ("otwarp.cli.types", "otwarp.cli.reproduce", "otwarp.reproduce.document", "otwarp.reproduce.store"):
        monkeypatch.setattr(f"{place}.check_place", lambda path, *_, **__: asked.append(path))
    before = {p: p.stat().st_mtime_ns for p in report.rglob("*")}
    assert main(["reproduce", "--out", str(report), "--docs", str(tmp_path / "paper.md")]) == 0
    assert asked and not any(path.is_relative_to(report) for path in asked)
    assert before == {p: p.stat().st_mtime_ns for p in report.rglob("*")}


def test_the_page_of_a_report_that_another_version_computed(report: Path, tmp_path: Path, capsys):
    """A GPU machine's copy need not be installed, so that its version is another; only its format matters here."""
    brought = tmp_path / "brought"
    shutil.copytree(report, brought)
    head = json.loads((brought / "reproduce.json").read_text())
    (brought / "reproduce.json").write_text(json.dumps(head | {"otwarp": "0.0.1"}))
    (tmp_path / "images").mkdir()
    assert main(["reproduce", "--out", str(brought), "--docs", str(tmp_path / "paper.md")]) == 0
    assert "which otwarp 0.0.1 wrote" in one_line(["--out", str(brought), "--quick", "--device", "cpu"], capsys)
    (brought / "reproduce.json").write_text(json.dumps(head | {"format": 1}))
    assert "(format 1)" in one_line(["--out", str(brought), "--docs", str(tmp_path / "paper.md")], capsys)


def one_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What a call with bad input says."""
    assert main(["reproduce", *arguments]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1, said
    return said[0]


def test_bad_input_is_one_line(report: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = ["--out", str(tmp_path / "new"), "--device", "cpu"]
    assert "did you mean strategy_a?" in one_line([*out, "--only", "stratgy_a"], capsys)
    said = one_line([*out, "--only", "fig11"], capsys)
    assert "--only is fig11" in said and not (tmp_path / "new").exists()
    assert all(name in said for name in ITEMS)
    assert "--out is missing" in one_line([], capsys)
    assert "/proc/paper, which cannot be written" in one_line(["--out", "/proc/paper"], capsys)
    assert "cuda:7" in one_line(["--out", str(tmp_path / "new"), "--device", "cuda:7"], capsys)
    assert "which holds a quick report" in one_line(["--out", str(report)], capsys)
    assert "seed 0" in one_line(["--out", str(report), "--quick", "--seed", "1"], capsys)
    assert "which has no" in one_line([*out, "--only", "setup", "--scenes", str(tmp_path)], capsys)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").write_text("mine")
    assert "holds something else" in one_line(["--out", str(tmp_path / "other")], capsys)
    assert "has no reproduce.json" in one_line(
        ["--out", str(tmp_path / "other"), "--docs", str(tmp_path / "p.md")], capsys
    )


def test_a_folder_of_another_version_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    head = tmp_path / "reproduce.json"
    for text, says in (
        ('{"format": 1, "otwarp": "0.0.1", "quick": true, "seed": 0}', "which otwarp 0.0.1 wrote"),
        ('{"format": 99, "otwarp": "9.9", "quick": true, "seed": 0}', "which otwarp 9.9 wrote (format 99)"),
        ("{", "contents cannot be read"),
        ("[]", "contents cannot be read"),
    ):
        head.write_text(text)
        assert says in one_line(["--out", str(tmp_path), "--quick"], capsys)
        assert head.read_text() == text and [p.name for p in tmp_path.iterdir()] == ["reproduce.json"]


def test_a_damaged_item_is_named(tmp_path: Path):
    reproduce(tmp_path, names=("contract",), quick=True, device="cpu")
    (tmp_path / "items" / "contract" / "item.json").write_text('{"format": 1}')
    with pytest.raises(InputError, match=r"item\.json: contents cannot be read"):
        reproduce(tmp_path, names=("contract",), quick=True, device="cpu")


def test_the_list_names_all_items(capsys: pytest.CaptureFixture[str]):
    assert main(["reproduce", "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(ITEMS)
    assert main(["reproduce", "--list", "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)) == list(ITEMS)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Value(number=2.57, spread=3.18), "2.57 ± 3.18"),
        (Value(number=0.8, interval=(0.444, 0.975)), "0.8 [0.444, 0.975]"),
        (Value(number=-1.5, error=0.123), "−1.5 (SE 0.12)"),
        (Value(number=0.5, text="half"), "half"),
        (Value(), "–"),
    ],
)
def test_values_are_printed_with_what_is_known_of_them(value: Value, text: str):
    assert value.said() == text


def test_what_reads_a_picture_aloud_is_given_no_elements():
    said = 'A run, as `otwarp run` draws it: "a" < b.'
    assert plain(said) == "A run, as otwarp run draws it: &quot;a&quot; &lt; b."


def test_powers_of_ten_are_raised():
    assert shown(5.46e-5) == "5.46·10⁻⁵" and shown(1234567.0) == "1.23·10⁶" and shown(0.05) == "0.05"
