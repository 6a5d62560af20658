"""The command line that benchmarks share: options reach what measures, and bad input is one line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from benchmarks.printed import sections_of
from benchmarks.report import PAGES, Section, check_places, command, commit, markers, positive, put_text, save_page
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.errors import InputError

SIZES = {"type": positive, "nargs": "+", "default": (), "help": "how many"}


def measure(device: str, *, rounds: int, sizes: tuple[int, ...]) -> Section:
    """What was asked for."""
    machine = Machine.look(pick_device(device))
    table = Table(title="Asked", head=("rounds", "sizes"), rows=[(str(rounds), str(list(sizes)))])
    return Section(name="asked", kind="cpu", machine=machine, tables=[table], data={"sizes": list(sizes)})


def run(monkeypatch, *words: str) -> None:
    monkeypatch.setattr("sys.argv", ["asked", *words])
    command(measure, "What is asked.", rounds=3, sizes=SIZES)


def test_options_reach_what_measures(monkeypatch, capsys, tmp_path: Path):
    file = tmp_path / "numbers.json"
    run(monkeypatch, "--sizes", "4", "9", "--out", str(file))
    assert "| 3 | [4, 9] |" in capsys.readouterr().out
    assert json.loads(file.read_text())["asked"]["sizes"] == [4, 9]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--device", "abacus"), "benchmarks: device is 'abacus'; allowed: cpu"),
        (("--rounds", "0"), "'0'; allowed: a whole number, 1 or more"),
        (
            ("--out", "/nowhere/numbers.json"),
            "benchmarks: --out is /nowhere/numbers.json, which cannot be written (No such file or directory)",
        ),
    ],
)
def test_bad_input_is_one_line_and_code_2(words, says, monkeypatch, capsys):
    with pytest.raises(SystemExit) as end:
        run(monkeypatch, *words)
    out, error = capsys.readouterr()
    assert end.value.code == 2 and says in error.splitlines()[-1] and not out


def test_a_page_that_cannot_be_written_is_refused_before_anything_is_measured(tmp_path: Path):
    page = tmp_path / "page.md"
    page.write_text("old")
    check_places(None, [page])
    assert page.read_text() == "old" and list(tmp_path.iterdir()) == [page]
    with pytest.raises(InputError, match=r"^--write is /proc/page\.md, which cannot be written \("):
        check_places(None, [page, Path("/proc/page.md")])
    save_page(page, "new")
    with pytest.raises(InputError, match=r"^docs/page\.md cannot be written: "):
        save_page(tmp_path / "none" / "page.md", "new")
    assert page.read_text() == "new"


def test_a_section_says_of_which_commit_it_is(monkeypatch):
    monkeypatch.delenv("OTWARP_COMMIT", raising=False)
    section = measure("cpu", rounds=1, sizes=())
    known = commit()
    assert section.commit == known == section.json()["commit"]
    if known:  # a copy without its history does not know
        assert re.fullmatch(r"[0-9a-f]{8,}\+?", known) and f" Commit {known}." in section.markdown().splitlines()[0]
    monkeypatch.setenv("OTWARP_COMMIT", "12345678")
    assert " Commit 12345678." in measure("cpu", rounds=1, sizes=()).markdown()


def test_every_section_of_the_pages_does():
    sections = 0
    for page in PAGES.glob("*.md"):
        for line in re.findall(
            r"^`python -m benchmarks\.[^`]*` on .*$", page.read_text(encoding="utf-8"), re.MULTILINE
        ):
            sections += 1
            assert re.search(r" Commit [0-9a-f]{8,}\+?\.$", line), f"{page.name}: {line}"
    assert sections > 30


def test_what_was_printed_elsewhere_goes_on_its_page():
    """What stands on a page, printed into a file, is put back as it was; lines before a section are not of it."""
    page = (PAGES / "vision.md").read_text(encoding="utf-8")
    for kind in ("cpu", "cuda"):
        begin, end = markers("vision", kind)
        stands = page.split(begin)[1].split(end)[0].strip("\n") + "\n"
        ((name, found, text),) = sections_of(f"training 1 of 3\n{stands}\n\n", "out.txt")
        assert (name, found) == ("vision", kind)
        assert put_text(page, name, found, text) == page
    both = "".join(
        f"`python -m benchmarks.{n}{d}` on a core.\n\n| a |\n" for n, d in (("a", ""), ("b", " --device cuda:0"))
    )
    assert [(name, kind) for name, kind, _ in sections_of(both, "out.txt")] == [("a", "cpu"), ("b", "cuda")]
    with pytest.raises(InputError, match=r"^out\.txt has no section of a benchmark; allowed"):
        sections_of("Killed", "out.txt")
