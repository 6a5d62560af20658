"""`python -m benchmarks.validation [--write]`: run tests/validation and print each law beside what was measured.

The figures are those that the tests compare. `--write` makes a page of each test module that ran as a whole,
docs/validation/NAME.md for test_NAME.py, and then the list of all pages in docs/validation.md. The same figures, test
by test, are printed by `python -m pytest tests/validation --validate -rP`.
"""

from __future__ import annotations

import argparse
import inspect
import json
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from benchmarks.report import check_places, run, save_page
from otwarp.bench.machine import Machine
from otwarp.device import pick_device
from otwarp.errors import InputError

ROOT = Path(__file__).resolve().parent.parent
PAGES = ROOT / "docs" / "validation"
SUMMARY = ROOT / "docs" / "validation.md"
BEGIN, END = "<!-- begin validation -->", "<!-- end validation -->"
GENERATED = "<!-- Written by python -m benchmarks.validation --write. -->"
HEAD = ("quantity", "law", "expected standard error", "known bias up to", "measured", "σ")


@dataclass
class Collector:
    """A pytest plugin that keeps the figures the `law` fixture records.

    Attributes:
        abouts: Docstring of each test, and of its module, by node id.
        rows: Figures of each test, in the order they were taken.
        failed: Tests that did not pass.
        partial: Files of which `--only` left tests out.
    """

    abouts: dict[str, tuple[str, str]] = field(default_factory=dict)
    rows: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)
    partial: set[str] = field(default_factory=set)

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep what the tests say about themselves."""
        for item in items:
            function, module = getattr(item, "function", None), getattr(item, "module", None)
            self.abouts[item.nodeid] = (inspect.getdoc(function) or "", inspect.getdoc(module) or "")

    def pytest_deselected(self, items: list[pytest.Item]) -> None:
        """Keep which files are not run as a whole."""
        self.partial |= {item.nodeid.partition("::")[0] for item in items}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep what a test measured."""
        if report.failed:
            self.failed.append(report.nodeid)
        if report.when == "call":
            found = [json.loads(str(value)) for name, value in report.user_properties if name == "law"]
            if found:
                self.rows[report.nodeid] = found


def figures(row: dict[str, Any]) -> tuple[str, ...]:
    """Cells of one comparison; of many elements, the one that comes nearest to failing."""
    name = row["quantity"] + (f" (worst of {row['count']})" if row["count"] > 1 else "")
    bias = f"{row['bias']:.2g}" if row["bias"] > 0.0 else "–"
    return (
        name.replace("|", "\\|"),
        f"{row['expected']:.6g}",
        f"{row['error']:.2g}",
        bias,
        f"{row['measured']:.6g}",
        f"{row['sigmas']:+.2f}",
    )


def grouped(found: Collector) -> dict[tuple[str, str], list[str]]:
    """Tests by file and function, parameters together; the quick one is left out where there is a precise one."""
    groups: dict[tuple[str, str], list[str]] = {}
    for test in found.rows:
        file, _, name = test.partition("::")
        groups.setdefault((file, name.split("[")[0]), []).append(test)
    return {(file, name): tests for (file, name), tests in groups.items() if (file, f"{name}_precisely") not in groups}


def page_name(file: str) -> str:
    """`walls.md` of `tests/validation/test_walls.py`."""
    return Path(file).stem.removeprefix("test_") + ".md"


def markdown(found: Collector, machine: Machine, command: str) -> dict[str, str]:
    """A page for each test module, by its file: one table per test, under the law it tests and its source."""
    pages: dict[str, list[str]] = {}
    for (file, name), tests in grouped(found).items():
        if file not in pages:
            title = Path(page_name(file)).stem.replace("_", " ").capitalize()
            about = found.abouts[tests[0]][1].split("\n\n")[0].replace("\n", " ")
            ran = f"`tests/validation/{Path(file).name}`, run by `{command}` on {machine.text()}."
            pages[file] = [GENERATED, "", f"# {title}", "", about, "", ran, ""]
        law, _, source = " ".join(found.abouts[tests[0]][0].split()).partition(" Source: ")
        failed = " **fails**" if set(tests) & set(found.failed) else ""
        lines = [f"`{name}`{failed}: {law}  ", f"*{source}*", ""] if source else [f"`{name}`{failed}: {law}", ""]
        lines += ["| " + " | ".join(HEAD) + " |", "|---" + "|---:" * 5 + "|"]
        lines += ["| " + " | ".join(figures(row)) + " |" for test in tests for row in found.rows[test]] + [""]
        pages[file] += lines
    return {file: "\n".join(lines) for file, lines in pages.items()}


def printed_rows(page: str) -> list[list[str]]:
    """Cells of all comparisons of a page."""
    lines = [line.replace("\\|", "¦") for line in page.splitlines() if line.startswith("| ")]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in rows if tuple(row) != HEAD]


def excess(row: list[str]) -> float:
    """How far a printed comparison is from its law beyond the known bias, in standard errors; 5 would fail."""
    error, bias = float(row[2]), 0.0 if row[3] == "–" else float(row[3])
    return max(abs(float(row[5])) - bias / error, 0.0)


def count(row: list[str]) -> int:
    """Elements for which a printed comparison stands."""
    _, found, number = row[0].partition("(worst of ")
    return int(number.rstrip(")")) if found else 1


def summary(pages: Path = PAGES) -> str:
    """The result, and the list of all pages with what each compares and how near it came to failing."""
    head = ["| page | what is compared | comparisons | farthest from its law |", "|---|---|---:|---:|"]
    lines, total, worst, failed = [], 0, 0.0, 0
    for page in sorted(pages.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if not text.startswith(GENERATED):
            continue
        title, about = text.split("\n\n")[1:3]
        rows = printed_rows(text)
        number, farthest = sum(map(count, rows)), max(map(excess, rows))
        total, worst, failed = total + number, max(worst, farthest), failed + text.count("**fails**")
        lines.append(f"| [{title[2:]}](validation/{page.name}) | {about} | {number} | {farthest:.1f} σ |")
    fails = "no test fails" if not failed else f"{failed} tests fail"
    result = f"**{total} comparisons on {len(lines)} subjects: {fails}; the farthest is {worst:.1f} σ off.**"
    return "\n".join([result, "", *head, *lines])


def put_on_page(page: str, text: str, begin: str = BEGIN, end: str = END) -> str:
    """Replace what stands between the markers.

    Raises:
        InputError: The page has no such markers.
    """
    if page.count(begin) != 1 or page.count(end) != 1:
        raise InputError(f"the page must hold the markers {begin} and {end} once each")
    before, rest = page.split(begin)
    return f"{before}{begin}\n{text}\n{end}{rest.split(end)[1]}"


def write_pages(texts: dict[str, str], partial: set[str]) -> None:
    """Write the pages of the files that ran as a whole, and the list of all pages."""
    for file, text in texts.items():
        if file in partial:
            print(f"docs/validation/{page_name(file)} is left as it was: --only left tests of it out", file=sys.stderr)
        else:
            save_page(PAGES / page_name(file), text)
    save_page(SUMMARY, put_on_page(SUMMARY.read_text(encoding="utf-8"), summary()))


def main() -> None:
    """Command line; the exit code is pytest's."""
    parser = argparse.ArgumentParser(
        description="Run the validation suite and print each law beside what was measured."
    )
    parser.add_argument("--device", default="cpu", help="cpu (default) or cuda:0")
    parser.add_argument("--only", default="", metavar="NAME", help="tests whose name contains NAME (pytest -k)")
    parser.add_argument("--quick", action="store_true", help="leave out the long tests")
    parser.add_argument("--write", action="store_true", help="rewrite the pages of docs/validation")
    arguments = parser.parse_args()
    check_places(None, (*PAGES.glob("*.md"), SUMMARY) if arguments.write else ())
    machine = Machine.look(pick_device(arguments.device))
    found = Collector()
    options = [str(ROOT / "tests" / "validation"), "--device", arguments.device, f"--rootdir={ROOT}"]
    options += [] if arguments.quick else ["--validate"]
    options += ["-k", arguments.only] if arguments.only else []
    code = int(pytest.main(options, plugins=[found]))
    device = "" if arguments.device == "cpu" else f" --device {arguments.device}"
    texts = markdown(found, machine, f"python -m benchmarks.validation{device}")
    print(*texts.values(), sep="\n")
    if arguments.write:
        write_pages(texts, found.partial)
    sys.exit(code)


if __name__ == "__main__":
    run(main)
