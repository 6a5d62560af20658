"""Tables of results, as text in cells: for the terminal and for documentation."""

from __future__ import annotations

from dataclasses import dataclass

NOTHING = "–"
"""In a cell that does not apply."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table: title, column heads, rows of text, and a note below it."""

    title: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    note: str = ""

    def markdown(self) -> str:
        """The table in Markdown; the first column is text, the others are numbers."""
        lines = [f"**{self.title}**", "", "| " + " | ".join(self.head) + " |"]
        lines.append("|---|" + "---:|" * (len(self.head) - 1))
        lines += ["| " + " | ".join(row) + " |" for row in self.rows]
        return "\n".join([*lines, "", self.note, ""] if self.note else [*lines, ""])
