"""Pages of the notebooks: `python -m docs.building.notebooks [NAME …]` runs them and writes what they say and draw.

A page is the notebook's text and code with its output, kept in docs/notebooks, so that the site is built in seconds and
without running anything. A test compares text and code with the notebook; another one runs it.
"""

from __future__ import annotations

import ast
import contextlib
import io
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

from docs.building.blocks import keep
from docs.building.gallery import EXAMPLES, LARGEST, WIDEST, at_root
from docs.building.links import DOCS

NOTEBOOKS = sorted((EXAMPLES / "notebooks").glob("*.py"))
PAGES = DOCS / "notebooks"
PICTURES = DOCS / "images" / "notebooks"
NOTE = """
[The notebook](../../examples/notebooks/{name}.py) as text; below its code stands what it said and drew here
(`python -m docs.building.notebooks {name}`).
"""
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
OUTPUT = re.compile(r"\n```text\n.*?^```\n|\n!\[.*?\]\(.*?\)\n", re.DOTALL | re.MULTILINE)
"""What of a page is not the notebook's."""


def page(file: Path, said: list[str] | None = None, drawn: list[list[str]] | None = None) -> str:
    """The Markdown of a notebook.

    Args:
        file: The notebook.
        said: Text that each code cell wrote; None for a page without output.
        drawn: Names of the figures of each code cell.
    """
    parts, n = [], 0
    for cell in cells(file):
        if cell.cell_type == "markdown":
            parts.append(cell.source + "\n")
            if len(parts) == 1:
                title, _, rest = cell.source.partition("\n")
                parts = [f"{title}\n{NOTE.format(name=file.stem)}\n{rest.strip()}\n"]
            continue
        parts.append(f"```py\n{cell.source}\n```\n")
        if said is not None and said[n].strip():
            lines = "\n".join(line.rstrip() for line in said[n].rstrip().splitlines())
            parts.append(f"```text\n{lines}\n```\n")
        about = HEADING.findall("\n".join(parts))[-1].rstrip(".?")
        parts += [
            f"![Drawn by this code: {about}](../images/notebooks/{name})\n" for name in (drawn[n] if drawn else ())
        ]
        n += 1
    return "\n".join(parts)


def without_output(text: str) -> str:
    """A page as `page` makes it without output."""
    return OUTPUT.sub("", text)


def cells(file: Path) -> list[Any]:
    """Cells of a notebook."""
    import jupytext

    return jupytext.read(file, fmt="py:percent").cells


def run(file: Path, folder: Path) -> tuple[list[str], list[list[str]]]:
    """Run a notebook in this process.

    Args:
        file: It.
        folder: Gets its figures.

    Returns:
        What each code cell wrote, with the value of its last line as a notebook shows it; names of its figures.
    """
    import matplotlib.pyplot as plt

    names: dict[str, object] = {"__name__": "__main__"}
    said: list[str] = []
    drawn: list[list[str]] = []
    plt.close("all")
    for cell in cells(file):
        if cell.cell_type != "code":
            continue
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            tree = ast.parse(cell.source)
            last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
            exec(compile(tree, str(file), "exec"), names)
            if isinstance(last, ast.Expr):
                value = eval(compile(ast.Expression(last.value), str(file), "eval"), names)
                if value is not None and not (cell.source.rstrip().endswith(";") or plt.get_fignums()):
                    print(repr(value))
        said.append(out.getvalue())
        drawn.append([])
        for number in plt.get_fignums():
            drawn[-1].append(f"{file.stem}_{sum(map(len, drawn)) + 1}.png")
            plt.figure(number).savefig(folder / drawn[-1][-1], dpi=110)
        plt.close("all")
    return said, drawn


def main(wanted: list[str]) -> None:
    """Run notebooks, all of them unless some are named, and write their pages."""
    PAGES.mkdir(exist_ok=True)
    for file in NOTEBOOKS:
        if wanted and file.stem not in wanted:
            continue
        print(file.stem, flush=True)
        with tempfile.TemporaryDirectory() as folder, at_root():
            said, drawn = run(file, Path(folder))
            for name in (name for names in drawn for name in names):
                keep(Path(folder) / name, PICTURES / name, LARGEST, WIDEST)
        (PAGES / f"{file.stem}.md").write_text(page(file, said, drawn), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
