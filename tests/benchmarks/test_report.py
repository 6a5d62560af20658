"""The command line that benchmarks share: options reach what measures, and bad input is one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.report import Section, check_places, command, positive, save_page
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
