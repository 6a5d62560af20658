"""Tables of results: printed, written as JSON, and put on the benchmark's page in docs/benchmarks."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from otwarp.bench.commit import commit_of
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.errors import InputError
from otwarp.files import check_place, written

PAGES = Path(__file__).resolve().parent.parent / "docs" / "benchmarks"
"""One page for each benchmark, named after its module: `terms.md` holds what `benchmarks.terms` found."""


def commit() -> str:
    """Short hash of the code that runs, with a + where files of the package or the benchmarks differ from it.

    A copy without its history tells it by the variable `OTWARP_COMMIT`.
    """
    return commit_of(PAGES.parents[1], "otwarp", "benchmarks", "scenes")


@dataclass(frozen=True, kw_only=True)
class Section:
    """What one benchmark found.

    Attributes:
        name: Module name, and name of its page; with the kind of device it names the markers there.
        kind: `cpu` or `cuda`.
        machine: Where it was measured.
        tables: For people.
        data: The same and more, for programs.
        asked: Options of the script other than the device, as typed.
        commit: Of the code that was measured, with a + where files had changed since; empty where nobody knows.
    """

    name: str
    kind: str
    machine: Machine
    tables: list[Table]
    data: dict[str, Any] = field(default_factory=dict)
    asked: str = ""
    commit: str = field(default_factory=lambda: commit())

    def markdown(self) -> str:
        """All tables under a line that says what was run and where."""
        device = "" if self.kind == "cpu" else " --device cuda:0"
        asked = f" {self.asked}" if self.asked else ""
        code = f" Commit {self.commit}." if self.commit else ""
        head = f"`python -m benchmarks.{self.name}{asked}{device}` on {self.machine.text()}.{code}"
        return "\n".join([head, "", *(table.markdown() for table in self.tables)])

    def json(self) -> dict[str, Any]:
        """For `--out`."""
        return {"device": self.kind, "commit": self.commit, "machine": self.machine.data(), **self.data}


def markers(name: str, kind: str) -> tuple[str, str]:
    """Lines between which a section stands on its page."""
    return f"<!-- begin {name} {kind} -->", f"<!-- end {name} {kind} -->"


def put_on_page(page: str, section: Section) -> str:
    """Replace what stands between the markers of a section.

    Raises:
        InputError: The page has no such markers.
    """
    return put_text(page, section.name, section.kind, section.markdown())


def put_text(page: str, name: str, kind: str, text: str) -> str:
    """Replace what stands between the markers of a section by a text.

    Args:
        page: All of its page.
        name, kind: Of the section.
        text: As its `markdown` is.

    Raises:
        InputError: The page has no such markers.
    """
    begin, end = markers(name, kind)
    if page.count(begin) != 1 or page.count(end) != 1:
        raise InputError(f"the page of {name} must hold the markers {begin} and {end} once each")
    before, rest = page.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n{text}\n{end}{after}"


def check_places(out: Path | None, pages: Iterable[Path] = ()) -> None:
    """Find out before anything is measured whether its numbers can be written to `out`, and its tables on the pages.

    Raises:
        InputError: They cannot.
    """
    if out is not None:
        check_place(out, "--out")
    for page in pages:
        check_place(page, "--write")


def save_page(page: Path, text: str) -> None:
    """Replace a page, as a whole or not at all."""
    with written(page, f"docs/{page.name}") as part:
        part.write_text(text, encoding="utf-8")


def write_pages(sections: Sequence[Section], pages: Path = PAGES) -> None:
    """Put each section on its page; either all are written or none.

    Raises:
        InputError: A page cannot be read, or lacks the markers.
    """
    pages_of = {}
    for section in sections:
        page = pages / f"{section.name}.md"
        try:
            text = page.read_text(encoding="utf-8")
        except OSError as error:
            raise InputError(f"docs/benchmarks/{page.name} cannot be read: {error.strerror}") from error
        pages_of[page] = put_on_page(text, section)
    for page, text in pages_of.items():
        save_page(page, text)


def save_json(file: Path, sections: Sequence[Section]) -> None:
    """Write the sections' data as one JSON object keyed by benchmark.

    Raises:
        InputError: The file cannot be written.
    """
    with written(file, f"--out {file}") as part:
        part.write_text(
            json.dumps({s.name: s.json() for s in sections}, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        )


def positive(text: str) -> int:
    """Argument type of a count.

    Raises:
        argparse.ArgumentTypeError: Not a whole number of 1 or more.
    """
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}; allowed: a whole number, 1 or more")
    return int(text)


def options(about: str, *, rounds: int | None) -> argparse.ArgumentParser:
    """The options that all benchmarks share."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--device", default="cpu", help="cpu (default) or cuda:0")
    parser.add_argument("-o", "--out", type=Path, metavar="FILE", help="write all numbers to FILE")
    usual = "each benchmark's own" if rounds is None else str(rounds)
    parser.add_argument("--rounds", type=positive, default=rounds, help=f"repeats of each figure (default: {usual})")
    return parser


def run(main: Callable[[], None]) -> None:
    """Run a command line; bad input is one line on standard error and exit code 2."""
    try:
        main()
    except InputError as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        sys.exit(2)


def command(measure: Callable[..., Section], about: str, *, rounds: int, **more: dict[str, Any]) -> None:
    """The command line of one benchmark: print its tables, and write its numbers where `--out` says.

    Args:
        measure: `(device, *, rounds, …)`.
        about: What it measures, for `--help`.
        rounds: Repeats of each figure, if nobody asks for more.
        more: Options of its own, which `measure` takes by these names, with what argparse is told about them.
    """
    parser = options(about, rounds=rounds)
    for name, how in more.items():
        parser.add_argument(f"--{name}", **how)
    asked = vars(parser.parse_args())
    file, device = asked.pop("out"), asked.pop("device")

    def main() -> None:
        check_places(file)
        section = measure(device, **asked)
        print(section.markdown())
        if file:
            save_json(file, [section])

    run(main)
