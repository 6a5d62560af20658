"""The code of the pages, run as by a reader: `python -m docs.building.blocks [PAGE …]` draws the tutorials' pictures.

Blocks of a page run in their order in one folder: `python` in one namespace, `bash` in a shell; `usda` and `toml` are
saved under the name in the nearest inline code before them. What a machine without GPU, device and network cannot run
in seconds has `<!-- not run: why -->` in the line before it. Blocks without a language need a person or a device, or
list commands to choose from; `py` is what files are made of (tests/extending puts them there).
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from docs.building.links import DOCS, ROOT

PAGES = [DOCS / "start.md", *sorted((DOCS / "tutorials").glob("*.md"))]
OTHERS = sorted({ROOT / "README.md", *DOCS.rglob("*.md")} - set(PAGES))
"""Pages beside the tutorials."""
PICTURES = DOCS / "images" / "tutorials"
PICTURE = re.compile(r"\]\((?:\.\./)?images/tutorials/([\w.]+)\)")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LEFT_OUT = re.compile(r"<!-- not run: (\S.*) -->\n\Z")
"""Before a block: why it does not run."""
SHARED = ("scenes", "studies", "vision", "examples")
"""What commands of the pages read."""
LARGEST = 150_000
"""Bytes of a picture."""
WIDEST = 1100
"""Pixels of one that would be larger."""


def pictures(page: Path) -> list[str]:
    """Names of the pictures that a page shows, which its code makes."""
    return PICTURE.findall(page.read_text(encoding="utf-8"))


def runs(page: Path) -> bool:
    """Whether any block of a page runs."""
    text = page.read_text(encoding="utf-8")
    found = (b for b in BLOCK.finditer(text) if b.group(1) in ("python", "bash"))
    return any(not LEFT_OUT.search(text[: block.start()]) for block in found)


@contextlib.contextmanager
def at_work(folder: Path) -> Iterator[None]:
    """Work in a folder that has what the pages read, drawing without a display; then go back."""
    import matplotlib.pyplot as plt

    for name in SHARED:
        (folder / name).symlink_to(ROOT / name)
    before, backend = Path.cwd(), plt.get_backend()
    plt.switch_backend("Agg")
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
        plt.close("all")
        plt.switch_backend(backend)


def run_page(page: Path, folder: Path) -> None:
    """Run the blocks of a page in a folder, in their order.

    Args:
        page: Markdown.
        folder: An empty one; keeps what the code writes.

    Raises:
        subprocess.CalledProcessError: A command failed.
    """
    text, names = page.read_text(encoding="utf-8"), {"__name__": "__main__"}
    bin = Path(sys.executable).parent
    known = {**os.environ, "PATH": f"{bin}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    with at_work(folder):
        for block in BLOCK.finditer(text):
            language, code = block.groups()
            if LEFT_OUT.search(text[: block.start()]):
                continue
            line = text.count("\n", 0, block.start()) + 1
            if language == "python":
                exec(compile("\n" * line + code, str(page), "exec"), names)
            elif language == "bash":
                subprocess.run(["bash", "-euc", code], check=True, env=known, stdin=subprocess.DEVNULL)
            elif names_of := re.findall(rf"`([\w.]+\.{language})`", text[: block.start()]):
                Path(names_of[-1]).write_text(code, encoding="utf-8")


def keep(picture: Path, place: Path, largest: int = LARGEST, widest: int = WIDEST) -> None:
    """Copy a picture, smaller and with fewer colours where it would be too large."""
    from PIL import Image

    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(picture, place)
    image = Image.open(picture).convert("RGB")
    image.thumbnail((widest, widest))
    for colors in (256, 128, 64, 32):
        if place.stat().st_size <= largest:
            return
        image.quantize(colors, dither=Image.Dither.FLOYDSTEINBERG).save(place, optimize=True)


def main(names: list[str]) -> None:
    """Run pages, all of them unless some are named, and keep their pictures."""
    for page in PAGES:
        if names and page.stem not in names:
            continue
        print(page.stem, flush=True)
        with tempfile.TemporaryDirectory() as folder:
            run_page(page, Path(folder))
            for name in pictures(page):
                keep(Path(folder) / name, PICTURES / name)


if __name__ == "__main__":
    main(sys.argv[1:])
