"""`python -m benchmarks.validation [--write]`: run tests/validation and print each law beside what was measured.

The figures are those that the tests compare; `--write` puts them between the markers of docs/validation.md. The same
figures, test by test, are printed by `python -m pytest tests/validation --validate -rP`.
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

from benchmarks.machine import Machine
from otwarp.device import pick_device
from otwarp.errors import InputError

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "validation.md"
BEGIN, END = "<!-- begin validation -->", "<!-- end validation -->"
HEAD = ("quantity", "law", "expected standard error", "known bias up to", "measured", "σ")


@dataclass
class Collector:
    """A pytest plugin that keeps the figures the `law` fixture records.

    Attributes:
        abouts: Docstring of each test, and of its module, by node id.
        rows: Figures of each test, in the order they were taken.
        failed: Tests that did not pass.
    """

    abouts: dict[str, tuple[str, str]] = field(default_factory=dict)
    rows: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep what the tests say about themselves."""
        for item in items:
            function, module = getattr(item, "function", None), getattr(item, "module", None)
            self.abouts[item.nodeid] = (inspect.getdoc(function) or "", inspect.getdoc(module) or "")

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


def markdown(found: Collector, machine: Machine, command: str) -> str:
    """One table per test, under the law it tests and its source."""
    lines = [f"`{command}` on {machine.text()}.", ""]
    last = ""
    for (file, name), tests in grouped(found).items():
        if file != last:
            last = file
            title = found.abouts[tests[0]][1].split("\n\n")[0].replace("\n", " ")
            lines += [f"### `{file.rsplit('/', 1)[-1]}`", "", title, ""]
        law, _, source = " ".join(found.abouts[tests[0]][0].split()).partition(" Source: ")
        failed = " **fails**" if set(tests) & set(found.failed) else ""
        lines += [f"`{name}`{failed}: {law}  ", f"*{source}*", ""] if source else [f"`{name}`{failed}: {law}", ""]
        lines += ["| " + " | ".join(HEAD) + " |", "|---" + "|---:" * 5 + "|"]
        lines += ["| " + " | ".join(figures(row)) + " |" for test in tests for row in found.rows[test]] + [""]
    return "\n".join(lines)


def put_on_page(page: str, text: str, begin: str = BEGIN, end: str = END) -> str:
    """Replace what stands between the markers.

    Raises:
        InputError: The page has no such markers.
    """
    if page.count(begin) != 1 or page.count(end) != 1:
        raise InputError(f"docs/validation.md must hold the markers {begin} and {end} once each")
    before, rest = page.split(begin)
    return f"{before}{begin}\n{text}\n{end}{rest.split(end)[1]}"


def main() -> int:
    """Command line; the exit code is pytest's."""
    parser = argparse.ArgumentParser(
        description="Run the validation suite and print each law beside what was measured."
    )
    parser.add_argument("--device", default="cpu", help="cpu (default) or cuda:0")
    parser.add_argument("--only", default="", metavar="NAME", help="tests whose name contains NAME (pytest -k)")
    parser.add_argument("--quick", action="store_true", help="leave out the long tests")
    parser.add_argument("--write", action="store_true", help="rewrite the tables of docs/validation.md")
    arguments = parser.parse_args()
    machine = Machine.look(pick_device(arguments.device))
    found = Collector()
    options = [str(ROOT / "tests" / "validation"), "--device", arguments.device, f"--rootdir={ROOT}"]
    options += [] if arguments.quick else ["--validate"]
    options += ["-k", arguments.only] if arguments.only else []
    code = int(pytest.main(options, plugins=[found]))
    device = "" if arguments.device == "cpu" else f" --device {arguments.device}"
    text = markdown(found, machine, f"python -m benchmarks.validation{device}")
    print(text)
    if arguments.write:
        PAGE.write_text(put_on_page(PAGE.read_text(), text))
    return code


if __name__ == "__main__":
    try:
        sys.exit(main())
    except InputError as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        sys.exit(2)
