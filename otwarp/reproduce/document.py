"""The page of the documents: the same items in Markdown, with small figures beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from otwarp.errors import InputError
from otwarp.files import check_place, written
from otwarp.reproduce.drawing import write_small
from otwarp.reproduce.item import GRADES
from otwarp.reproduce.numbering import FIGURES, PAIR, TABLES
from otwarp.reproduce.parts import how_long, where
from otwarp.reproduce.registry import ITEMS
from otwarp.reproduce.report import PAPER, took, whose
from otwarp.reproduce.store import Done, Store

PREFIX = "paper_"
"""Of the figures' names."""


def write_page(page: Path, store: Store, done: Sequence[Done]) -> Path:
    """Write the page, and its figures into `images` beside it; figures of items that are gone go.

    Args:
        page: A file of Markdown.
        store: The report.
        done: Its items.

    Raises:
        InputError: One of them cannot be written.
    """
    check_place(page, "--docs")
    images = page.parent / "images"
    if not images.is_dir():
        raise InputError(f"--docs is {page}, beside which there is no folder images for its figures; allowed: a page "
                         f"of "
                         "documents")  # fmt: skip
    check_place(images / f"{PREFIX}.png", "--docs")
    kept = set()
    for one in done:
        for figure in one.result.figures:
            file = images / f"{PREFIX}{figure.file}"
            write_small(one.folder / figure.file, file)
            kept.add(file)
    for file in set(images.glob(f"{PREFIX}*.png")) - kept:
        file.unlink()
    with written(page, "--docs") as part:
        part.write_text(markdown(store, done), encoding="utf-8")
    return page


def markdown(store: Store, done: Sequence[Done]) -> str:
    """The whole page."""
    quick = " --quick" if store.quick else ""
    lines = [
        "<!-- Written by otwarp reproduce --docs docs/paper.md. -->",
        "",
        "# The paper, reproduced",
        "",
        "```",
        "otwarp reproduce --out out/paper             # every table and figure; goes on where it was interrupted",
        "otwarp reproduce --out out/quick --quick     # in minutes on two cores",
        "otwarp reproduce --out out/quick --quick --only rendering --only strategy_a",
        "otwarp reproduce --out out/paper --only fig6   # or table2: by a number of the figures and tables below",
        "otwarp reproduce --list                      # the items, their figures and tables, and what they show",
        "```",
        "",
        f"Every table and figure of {PAPER}, ours beside theirs. The command writes `report.html` (one file, figures "
        "embedded), figures as PNG, series as CSV, all numbers as JSON and CSV. This page is written by it, too: by "
        f"`otwarp reproduce --out DIR{quick}` and `--docs docs/paper.md`.",
        "",
        *_kind(store),
        "How well a figure of the paper is known: " + "; ".join(f"**{g}** {said}" for g, said in GRADES.items())
        + ". SE is a standard error, brackets hold 95 % intervals, ± after a mean is the spread of what it is the "
          "mean of. Figures and tables have numbers of this report, which are not the paper's.",
        "",
        f"{took(done)} {whose(done)}",
        "",
    ]  # fmt: skip
    for one in done:
        lines += _item(one)
    missing = [item.title for name, item in ITEMS.items() if name not in {one.name for one in done}]
    if missing:
        lines += ["## Not computed", "", "; ".join(missing) + ".", ""]
    return "\n".join(lines)


def _kind(store: Store) -> list[str]:
    if not store.quick:
        return []
    said = (
        "The figures below are those of a quick report: fewer trials, a reduced network table, as each item says. The "
        "full one (VGG16, ResNet18 and ResNet50 at 224 pixels with five seeds, 2,000 simulated operators) belongs on a "
        "GPU, `--device cuda:0`; it was not run for this page."
    )
    return [said, ""]


def _item(one: Done) -> list[str]:
    found = one.result
    lines = [f"## {one.title}", ""]
    for number, figure in zip(FIGURES[one.name], found.figures, strict=True):
        lines += [
            f"![{_words(figure.caption).replace('`', '')}](images/{PREFIX}{figure.file})",
            "",
            f"*Figure {number}. {figure.caption}*",
            "",
        ]
    first, *others = TABLES[one.name]
    lines += [f"**Table {first}. {PAIR}**", "", "| | paper | | otwarp | |", "|---|---|---|---|---|"]
    for row in found.comparisons:
        unit = f" [{row.unit}]" if row.unit else ""
        lines.append(_row(row.what + unit, row.paper.said(), row.grade, row.ours.said(), row.remark))
    lines += ["", _words(found.definition), "", _words(found.difference), ""]
    if found.incomparable:
        lines += ["**What cannot be compared.**", "", *(f"- {_words(line)}" for line in found.incomparable), ""]
    for number, table in zip(others, found.tables, strict=True):
        lines += [
            f"**Table {number}. {table.title}**",
            "",
            _row(*table.head),
            "|---|" + "---:|" * (len(table.head) - 1),
        ]
        lines += [*(_row(*row) for row in table.rows), ""]
        if table.note:
            lines += [_words(table.note), ""]
    computed = "; ".join(f"{key}: {value}" for key, value in found.computed.items())
    return [*lines, f"*Computed in {how_long(one.parts)} on {where(one.parts)}. {_words(computed)}.*", ""]


def _row(*cells: str) -> str:
    return "| " + " | ".join(_words(cell).replace("|", "\\|") for cell in cells) + " |"


def _words(text: str) -> str:
    return " ".join(text.split())
