"""The gallery of examples: `python -m docs.building.gallery [EXAMPLE …]` runs them and draws docs/gallery.md anew.

What a picture shows is said by the table in examples/README.md. Examples that train take minutes, and are not run.
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

ROW = re.compile(r"^\| \[(\w+)\]\(\w+\.py\) \| (.*) \|$", re.MULTILINE)
HEAD = """# Gallery

What the [examples](../examples/README.md) draw, each of them one idea in at most 40 lines. A title leads to the code.
`python -m examples.first_run` runs one; `python -m docs.building.gallery` runs all and draws this page anew.
"""


def rows() -> dict[str, str]:
    """What one sees of each example that does not train, in the order of their page."""
    table = ROW.findall((EXAMPLES / "README.md").read_text(encoding="utf-8"))
    return {name: seen for name, seen in table if not name.startswith("train_")}


def page() -> str:
    """The Markdown of the gallery."""

    def section(name: str, seen: str) -> str:
        said = f"{seen[0].upper()}{seen[1:]}."
        return f"\n## [{name}](../examples/{name}.py)\n\n{said}\n\n![{seen}](images/gallery/{name}.png)\n"

    return HEAD + "".join(section(name, seen) for name, seen in rows().items())


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
    """Run examples, all of them unless some are named, keep their pictures, and write the page."""
    for name in rows():
        if names and name not in names:
            continue
        print(name, flush=True)
        with tempfile.TemporaryDirectory() as folder, at_root():
            import_module(f"examples.{name}").main(out=folder)
            keep(Path(folder) / DRAWS.get(name, f"{name}.png"), PICTURES / f"{name}.png", LARGEST, WIDEST)
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
