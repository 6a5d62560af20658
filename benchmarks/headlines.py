"""`python -m benchmarks.headlines [--write]`: the figures of docs/benchmarks.md, read from the pages under it.

A headline names a table of a page, some of its rows and some of its columns; it holds no number of its own, so the
short page cannot say anything else than the pages that the scripts write.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from benchmarks.report import PAGES, check_places, markers, run, save_page
from otwarp.errors import InputError

SUMMARY = PAGES.parent / "benchmarks.md"
BEGIN, END = "<!-- begin headlines -->", "<!-- end headlines -->"
KINDS = ("cpu", "cuda")


@dataclass(frozen=True)
class Headline:
    """Some figures of one table.

    Attributes:
        title: Over the table on the short page.
        script: Name of the benchmark, and of its page.
        table: Beginning of the title of the table there.
        columns: Head on the short page → section (`cpu` or `cuda`) and head there.
        rows: First cell on the short page → how the row there begins, its cells apart by ` | `; blank where a section
            lacks the row.
        first: Head of the first column.
    """

    title: str
    script: str
    table: str
    columns: dict[str, tuple[str, str]]
    rows: dict[str, str]
    first: str = ""


RATE = {"one CPU core": ("cpu", "rate"), "H200": ("cuda", "rate"), "unit": ("cpu", "unit")}
TERMS = (
    "Brownian noise",
    "harmonic trap",
    "tabulated trap, bilinear, 1e-3",
    "rotation: 6×6 mobility, 5 spheres",
    "hydrodynamic coupling of two beads",
    "body–body contact, touching",
)

HEADLINES = (
    Headline(
        "How fast",
        "speed",
        "Speed, beside other programs",
        RATE,
        {
            "bead in a spring, Euler–Maruyama": "bead in a spring, eulerMaruyama",
            "bead in a spring, Heun": "bead in a spring, heun",
            "… NumPy, written for this alone": "→ NumPy",
            "… C, written for this alone": "→ C, gcc",
            "… CUDA C, written for this alone": "→ CUDA C by CuPy",
            "bead in a table of 10⁻³, Heun": "bead in a bilinear table 1e-3, heun",
            "robot of five spheres, three tables that end at 1 µm, Heun": (
                "five-element robot, three bilinear tables that end at 1 µm, heun"
            ),
            "10⁶ soft spheres that find their neighbours": "case b, 1e+06 spheres",
        },
        "workload",
    ),
    Headline(
        "What force accuracy costs: one bead, one trap, Heun",
        "forces",
        "Force models: error against run time",
        {
            "one CPU core [ns/step]": ("cpu", "ns per bead-step"),
            "H100 [ns/step]": ("cuda", "ns per bead-step"),
            "largest error over the peak force": ("cpu", "largest, region"),
            "rms error, trapped bead": ("cpu", "rms error, trapped bead"),
        },
        {
            name: name
            for name in (
                "harmonic, radial + axial",
                "piecewise, radial + axial",
                "bilinear table 1e-3",
                "bilinear table 1e-4",
                "bicubic table 1e-5",
                "exact",
            )
        },
        "force model",
    ),
    Headline(
        "What a per cent costs: variances, correlations and escapes all within 1 % of the Fokker–Planck solution",
        "integrators",
        "Time to 1 %",
        {
            "one CPU core [ns per relaxation time]": ("cpu", "ns per relaxation time at 1 %, all three"),
            "H100 [ns per relaxation time]": ("cuda", "ns per relaxation time at 1 %, all three"),
            "Euler–Maruyama takes, H100": ("cuda", "Euler–Maruyama takes"),
        },
        {name: name for name in ("Euler–Maruyama", "Leimkuhler–Matthews", "Heun, default", "exponential")},
        "integrator",
    ),
    Headline(
        "What a term costs where it is; nothing where it is not [ns per body-step]",
        "terms",
        "Cost of each term",
        {"one CPU core": ("cpu", "cost"), "H200": ("cuda", "cost")},
        {name: name for name in TERMS},
        "term",
    ),
    Headline(
        "What float64 costs [times float32]",
        "precision",
        "Run time",
        {"one CPU core": ("cpu", "float64 over float32"), "H100": ("cuda", "float64 over float32")},
        {name: name for name in ("bead, harmonic trap", "bead, tabulated trap", "robot of 5 spheres, 3 traps")},
        "scene",
    ),
    Headline(
        "One world beside the clock [simulated seconds per second]",
        "realtime",
        "One world",
        {"one CPU core": ("cpu", "real-time factor"), "bodies": ("cpu", "bodies")},
        {
            name: name
            for name in (
                "`single_bead`",
                "`strategy_b`",
                "`cell_delivery`",
                "`microfluidic_channel`",
                "`ten_thousand_cells`",
            )
        },
        "scene",
    ),
    Headline(
        "Two robots that squeeze a cell, and the same bodies apart [simulated seconds per second, all worlds together]",
        "contact",
        "One step",
        {"one CPU core": ("cpu", "worlds × real time"), "H200": ("cuda", "worlds × real time")},
        {
            f"{about}, {worlds} world{'s' * (worlds != '1')}": f"`{name}` | {worlds}"
            for worlds in ("1", "131,072")
            for about, name in (("apart", "teleop_small"), ("squeezing", "cell_delivery"))
        },
        "scene",
    ),
    Headline(
        "What a person feels: R² of rendered against model force",
        "haptics",
        "R² of rendered against model force",
        {name: ("cpu", name) for name in ("axial", "radial", "axial, 55 µm encoder", "radial, 55 µm encoder")},
        {name: name for name in ("10 mm/s", "200 mm/s", "paper, its definitions")},
        "peak speed",
    ),
    Headline(
        "Stress tests of stability, by how a run ended",
        "stability",
        "Letters",
        {"meaning": ("cpu", "meaning"), "cells": ("cpu", "cells")},
        {name: name for name in ("A", "S", "R", "X", "W")},
        "letter",
    ),
)


def cells(line: str) -> list[str]:
    """Cells of a line of a Markdown table."""
    return [cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")]


def read_page(script: str, kind: str, pages: Path = PAGES) -> str:
    """What stands between the markers of a section, or nothing."""
    begin, end = markers(script, kind)
    _, found, rest = (pages / f"{script}.md").read_text(encoding="utf-8").partition(begin)
    return rest.split(end)[0] if found else ""


def read_table(section: str, title: str) -> list[dict[str, str]]:
    """Rows of the first table whose title begins so, by their heads; the first cell also under an empty head."""
    _, found, rest = section.partition(f"**{title}")
    if not found:
        return []
    lines = [line for line in rest.split("\n\n")[1].splitlines() if line.startswith("|")]
    head = cells(lines[0])
    return [dict(zip(["", *head], [" | ".join(row), *row], strict=True)) for row in map(cells, lines[2:])]


def figure(rows: list[dict[str, str]], name: str, column: str) -> str:
    """A cell, or nothing where the row is missing or was skipped."""
    row = next((row for row in rows if row[""].startswith(f"{name} | ")), None) or next(
        (row for row in rows if row[""].startswith(name)), {}
    )
    text = row.get(column, "")
    return "" if text.startswith("skipped") else text


def markdown(headline: Headline, pages: Path = PAGES) -> str:
    """A headline's table, under a title that leads to the page it is from.

    Raises:
        InputError: A row is in none of the sections that it is looked for in.
    """
    tables = {kind: read_table(read_page(headline.script, kind, pages), headline.table) for kind in KINDS}
    lines = [f"**{headline.title}** ([all of it](benchmarks/{headline.script}.md))", ""]
    lines.append("| " + " | ".join([headline.first, *headline.columns]) + " |")
    lines.append("|---|" + "---:|" * len(headline.columns))
    for label, name in headline.rows.items():
        figures = [figure(tables[kind], name, column) for kind, column in headline.columns.values()]
        if not any(figures):
            raise InputError(f"docs/benchmarks/{headline.script}.md has no row {name!r} under {headline.table!r}")
        lines.append("| " + " | ".join([label, *figures]) + " |")
    return "\n".join([*lines, ""])


def machine(section: str) -> str:
    """Processor or device of a section, from the line above its tables."""
    return section.strip().splitlines()[0].partition("` on ")[2].partition(", Linux")[0]


def summary(pages: Path = PAGES) -> str:
    """All headlines, under the machines that they were measured on."""
    machines = dict.fromkeys(
        machine(section)
        for kind in KINDS
        for headline in HEADLINES
        if (section := read_page(headline.script, kind, pages))
    )
    return "\n".join([f"On {'; '.join(machines)}.", "", *(markdown(headline, pages) for headline in HEADLINES)])


def write() -> None:
    """Put the headlines between the markers of docs/benchmarks.md."""
    before, _, rest = SUMMARY.read_text(encoding="utf-8").partition(BEGIN)
    save_page(SUMMARY, f"{before}{BEGIN}\n{summary()}\n{END}{rest.partition(END)[2]}")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="The figures that docs/benchmarks.md states.")
    parser.add_argument("--write", action="store_true", help="put them into docs/benchmarks.md")
    arguments = parser.parse_args()
    check_places(None, (SUMMARY,) if arguments.write else ())
    print(summary())
    if arguments.write:
        write()


if __name__ == "__main__":
    run(main)
