"""Figures and tables of the report by number: counted over all items, the same in every report."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence

from otwarp.errors import InputError
from otwarp.reproduce.item import Item
from otwarp.reproduce.registry import ITEMS

NUMBERED = re.compile(r"(fig|figure|table)[ ._-]*(\d{1,9})", re.IGNORECASE)
"""`fig6`, `Figure 6`, `table2`."""


def _counted(counts: Sequence[int]) -> dict[str, range]:
    """Numbers of each item, the first is 1."""
    ends = [sum(counts[: n + 1]) for n in range(len(counts))]
    return {name: range(end - count + 1, end + 1) for name, end, count in zip(ITEMS, ends, counts, strict=True)}


FIGURES = _counted([item.figures for item in ITEMS.values()])
"""Name of an item → numbers of its figures, also where it is not done."""

TABLES = _counted([item.tables for item in ITEMS.values()])
"""The same of its tables; the first of them is the one of theirs and ours."""

PAIR = "The paper beside otwarp"
"""Title of that one."""


def numbers_said(name: str) -> str:
    """Figures and tables of an item in words, such as `figures 5 and 6, tables 12 and 13`."""
    parts = [_said("figure", FIGURES[name]), _said("table", TABLES[name])]
    return ", ".join(part for part in parts if part)


def _said(kind: str, numbers: range) -> str:
    if len(numbers) < 2:
        return "".join(f"{kind} {n}" for n in numbers)
    between = " and " if len(numbers) == 2 else " to "
    return f"{kind}s {numbers[0]}{between}{numbers[-1]}"


def chosen(names: Sequence[str]) -> list[Item]:
    """Items by name, or by the number of a figure or table of the report, each once, in the report's order.

    Args:
        names: Such as `delivery`, `fig6`, `table2`; none for all items.

    Raises:
        InputError: An unknown name or number.
    """
    asked = {item_of(name) for name in names}
    return [item for name, item in ITEMS.items() if not names or name in asked]


def told(names: Sequence[str]) -> list[str]:
    """For each name that is a number, a line that says what it means; it could be taken for one of the paper."""
    return [f"{name} is of this report, not of the paper: in {item_of(name)} ({ITEMS[item_of(name)].title})"
            for name in names if name not in ITEMS]  # fmt: skip


def item_of(name: str) -> str:
    """The name of the item that a name, or the number of a figure or table, means.

    Raises:
        InputError: None.
    """
    if name in ITEMS:
        return name
    if (found := NUMBERED.fullmatch(name.strip())) is None:
        near = difflib.get_close_matches(name, ITEMS, n=1, cutoff=0.4)
        raise InputError(f"--only is {name}; allowed: {_allowed()}{f'; did you mean {near[0]}?' if near else ''}")
    numbers, number = TABLES if found[1].lower() == "table" else FIGURES, int(found[2])
    for item, own in numbers.items():
        if number in own:
            return item
    raise InputError(f"--only is {name}; allowed: {_allowed()}")


def _allowed() -> str:
    figure, table = (max(own[-1] for own in numbers.values() if own) for numbers in (FIGURES, TABLES))
    return (f"{', '.join(ITEMS)}, or by the report's own numbers, which are not the paper's, fig1 to fig{figure} and "
            f"table1 to table{table}")  # fmt: skip
