"""The gallery: `python -m docs.building.gallery [NAME …]` runs examples and notebooks and draws docs/gallery.md anew.

What a picture shows is said by the tables in examples/README.md. Examples that train take minutes, and are not run.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from docs.building.blocks import keep
from docs.building.links import DOCS, ROOT

EXAMPLES = ROOT / "examples"
PAGE = DOCS / "gallery.md"
PICTURES = DOCS / "images" / "gallery"
LARGEST = 60_000
"""Bytes of a picture."""
WIDEST = 900
"""Pixels of one that would be larger."""
DRAWS = {"record_and_plot": "path.png"}
"""Where an example draws something else than its name."""
SHOWN = {"robot_forces": 1, "microscope_depth": 2}
"""Which figure of a notebook is shown, where it is not the last one."""

ROW = re.compile(r"^\| \[(\w+)\]\(((?:notebooks/)?\w+\.py)\) \| (.*) \|$", re.MULTILINE)
HEAD = """# Gallery

What the [examples](../examples/README.md) draw, each of them one idea on one screen, and what
[notebooks](../examples/README.md#notebooks) find. A title leads to the code, or to the notebook as it ran.
`python -m examples.first_run` runs one; `python -m docs.building.gallery` runs all and draws this page anew.
"""


def rows() -> dict[str, tuple[Path, str]]:
    """File of each example that does not train and of each notebook, and what one sees, in the order of their page."""
    table = ROW.findall((EXAMPLES / "README.md").read_text(encoding="utf-8"))
    return {name: (EXAMPLES / file, seen) for name, file, seen in table if not name.startswith("train_")}


def page() -> str:
    """The Markdown of the gallery."""

    def section(name: str, file: Path, seen: str) -> str:
        code, said = f"../{file.relative_to(ROOT).as_posix()}", f"{seen[0].upper()}{seen[1:]}."
        to = code if file.parent == EXAMPLES else f"notebooks/{name}.md"
        return f"\n## [{name}]({to})\n\n{said}\n\n![{seen}](images/gallery/{name}.png)\n"

    return HEAD + "".join(section(name, file, seen) for name, (file, seen) in rows().items())


def run_notebook(file: Path) -> None:
    """Run the cells of a notebook in their order, in this process and not in a kernel; pyplot keeps its figures."""
    import jupytext

    names: dict[str, object] = {"__name__": "__main__"}
    for cell in jupytext.read(file, fmt="py:percent").cells:
        if cell.cell_type == "code":
            exec(compile(cell.source, str(file), "exec"), names)


def draw(name: str, file: Path, folder: Path) -> Path:
    """Run an example or a notebook.

    Args:
        name: Of it.
        file: It.
        folder: Where it may write.

    Returns:
        The picture to show.
    """
    import matplotlib.pyplot as plt

    if file.parent == EXAMPLES:
        import_module(f"examples.{name}").main(out=folder)
        return folder / DRAWS.get(name, f"{name}.png")
    plt.close("all")
    run_notebook(file)
    plt.figure(SHOWN.get(name, plt.get_fignums()[-1])).savefig(folder / "figure.png", dpi=110)
    return folder / "figure.png"


@contextlib.contextmanager
def at_root() -> Iterator[None]:
    """Run from the root of the repository, as examples are, drawing without a display; then go back."""
    import matplotlib.pyplot as plt

    before, backend = Path.cwd(), plt.get_backend()
    plt.switch_backend("Agg")
    os.chdir(ROOT)
    try:
        yield
    finally:
        os.chdir(before)
        plt.close("all")
        plt.switch_backend(backend)


def main(names: list[str]) -> None:
    """Run examples and notebooks, all of them unless some are named, keep their pictures, and write the page."""
    for name, (file, _) in rows().items():
        if names and name not in names:
            continue
        print(name, flush=True)
        with tempfile.TemporaryDirectory() as folder, at_root():
            keep(draw(name, file, Path(folder)), PICTURES / f"{name}.png", LARGEST, WIDEST)
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
