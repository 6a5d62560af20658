"""README quotes the cost of terms from docs/benchmarks/terms.md: the same figures."""

from __future__ import annotations

from pathlib import Path

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
    table = (ROOT / "README.md").read_text().split("| term | one CPU core | H100 |")[1].split("\n\n")[0]
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


def test_the_list_of_scripts_is_whole():
    folder = ROOT / "benchmarks"
    text = (folder / "README.md").read_text()
    for script in folder.glob("[a-z]*.py"):
        assert f"`{script.stem}" in text or f"`{script.name}`" in text, script.name
