"""README quotes figures of the pages under docs/benchmarks: the same ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.headlines import figure, machine, read_page, read_table

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[2]


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split("|")[1:-1]]


def costs(kind: str) -> dict[str, str]:
    """Median costs of `python -m benchmarks.terms` by term, as printed."""
    page = (ROOT / "docs" / "benchmarks" / "terms.md").read_text()
    block = page.split(f"<!-- begin terms {kind} -->")[1].split(f"<!-- end terms {kind} -->")[0]
    rows = [cells(line) for line in block.splitlines() if line.startswith("|")]
    return {row[0]: row[3].split()[0] for row in rows if len(row) == 6 and row[0] != "term"}


def test_readme_quotes_the_printed_costs():
    gpu = machine(read_page("terms", "cuda")).split()[1].rstrip(",")
    table = (ROOT / "README.md").read_text().split(f"| term | one CPU core | {gpu} |")[1].split("\n\n")[0]
    rows = [cells(line) for line in table.splitlines()[2:]]
    assert len(rows) > 8
    cpu, cuda = costs("cpu"), costs("cuda")
    for term, here, there in rows:
        assert (here, there) == (cpu[term], cuda[term]), term


def test_readme_quotes_the_printed_real_time_factor():
    page = (ROOT / "docs" / "benchmarks" / "realtime.md").read_text()
    row = next(cells(line) for line in page.splitlines() if line.startswith("| `cell_delivery`"))
    factor = float(row[4].split()[0])
    assert f"The cell delivery steps at {factor:.0f} times real time" in (ROOT / "README.md").read_text()


def rate(kind: str, row: str) -> float:
    """Median rate of a row of docs/benchmarks/speed.md [1/s]."""
    rows = read_table(read_page("speed", kind), "Speed, beside other programs")
    return float(figure(rows, row, "rate").split()[0])


def test_readme_quotes_the_printed_speeds():
    text = " ".join((ROOT / "README.md").read_text().split())
    bead, in_c = (1e9 / rate("cpu", row) for row in ("bead in a spring, eulerMaruyama", "→ C, gcc"))
    table = 1e9 / rate("cuda", "bead in a bilinear table 1e-3, eulerMaruyama")
    gpu = machine(read_page("speed", "cuda")).split()[1].rstrip(",")
    for sentence in (
        f"costs {bead:.0f} ns a step on one CPU core by Euler–Maruyama, vector code in C for nothing else {in_c:.0f}",
        f"on an {gpu} with a million worlds a step in a force table of 10⁻³ error takes {table:.2g} ns",
    ):
        assert sentence in text


def test_readme_quotes_what_was_printed_of_a_gpu():
    text = " ".join((ROOT / "README.md").read_text().split())
    study, vision = read_page("study", "cuda"), read_page("vision", "cuda")
    maps, sent = (read_table(study, title) for title in ("Capture map", "The shipped cell delivery"))
    seconds = float(figure(maps, "64 × 64 points × 1,024 trials, run", "time [s]"))
    deliveries = float(figure(sent, "100,000", "time [s]"))
    rows = read_table(vision, "Poses and images a second")
    poses, images = (
        float(figure(rows, "two-index, 0.2 µm", column)) for column in ("poses/s, 32 together", "images/s of these")
    )
    assert f"a capture map of 4.2 million trials takes {seconds:.1f} s, 100,000 deliveries {deliveries:.0f} s" in text
    assert f"renders {poses:,.0f} poses and {images:,.0f} images a second" in text


def test_the_list_of_scripts_is_whole():
    folder = ROOT / "benchmarks"
    text = (folder / "README.md").read_text()
    for script in folder.glob("[a-z]*.py"):
        assert f"`{script.stem}" in text or f"`{script.name}`" in text, script.name
