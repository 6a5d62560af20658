"""A new user's way, command by command: from nothing to a first picture, and on to a scene of his own.

Everything is fresh: a clone in a temporary folder, an environment without packages, empty caches of kernels and tables,
and none of pip. Packages come from wherever pip gets them, whose pace is part of what is measured. `--write` puts it on
docs/install.md.
"""

from __future__ import annotations

import argparse
import itertools
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.report import Section, check_places, put_on_page, run, save_page
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.errors import InputError

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "install.md"

FIRST = (
    "git clone --quiet {root} otwarp",
    "cd otwarp",
    "{python} -m venv .venv",
    "source .venv/bin/activate",
    "pip install --quiet --constraint constraints.txt '.[mesh]'",
    "otwarp preview cell_delivery -o first.png",
)
"""To a first picture."""

OWN = (
    "otwarp new chamber mine.usda",
    "python -c \"import trimesh; trimesh.creation.icosphere(radius=3).export('part.stl')\"",
    "otwarp import part.stl --position -2,-3,4 --into mine.usda",
    "otwarp validate mine.usda",
    "otwarp run mine.usda",
    "otwarp preview out/mine --time 1 -o mine.png",
)
"""And on to a scene of one's own, with a mesh of one's own (the second line stands for a CAD program), its run and its
picture."""

PATIENCE = 1800.0
"""For all of it [s]."""

MARK = "otwarp-new-user"


def measure(python: str = sys.executable) -> Section:
    """Type the commands into one shell, and time each.

    Raises:
        InputError: One of them fails, or leaves no picture.
    """
    machine = Machine.look(pick_device("cpu"))
    with tempfile.TemporaryDirectory(prefix="otwarp-new-user-") as folder:
        there = Path(folder)
        spent = _type(there, [line.format(root=ROOT, python=python) for line in (*FIRST, *OWN)])
        for picture in ("first.png", "mine.png"):
            if not (there / "otwarp" / picture).stat().st_size:
                raise InputError(f"{picture} is empty")
    lines = [line.format(root="URL", python="python3") for line in (*FIRST, *OWN)]
    since = itertools.accumulate(wall for wall, _ in spent)
    rows = [
        (f"`{line}`", f"{wall:.1f}", f"{cpu:.1f}", f"{passed:.0f}")
        for line, (wall, cpu), passed in zip(lines, spent, since, strict=True)
    ]
    (first, first_cpu), (every, every_cpu) = (np.sum(spent[:n], axis=0) for n in (len(FIRST), len(spent)))
    note = (
        f"First picture after {len(FIRST)} commands and {first:.0f} s, of which a processor works {first_cpu:.0f} s; "
        f"the picture of an own scene's run after {len(spent)} commands and {every:.0f} s, of which {every_cpu:.0f} s."
    )
    table = Table(
        title="A new user's way [s]", head=("command", "wall", "processor", "since the start"), rows=rows, note=note
    )
    return Section(name="new_user", kind="cpu", machine=machine, tables=[table], data={"seconds": spent})


def _type(folder: Path, lines: list[str]) -> list[tuple[float, float]]:
    """Wall and processor time of each line of a shell that knows nothing yet [s]."""
    known = ("PYTHONPATH", "VIRTUAL_ENV", "WARP_CACHE_PATH", "OTWARP_CACHE")
    environment = {name: value for name, value in os.environ.items() if name not in known}
    environment |= {"WARP_CACHE_PATH": str(folder / "kernels"), "OTWARP_CACHE": str(folder / "tables")}
    environment |= {"PIP_NO_CACHE_DIR": "1"}
    script = ["set -e", *(f'{line}\necho "{MARK} $(date +%s.%N)"; times' for line in lines)]
    begun = time.time()
    done = subprocess.run(
        ["bash", "-c", "\n".join(script)], cwd=folder, env=environment, capture_output=True, text=True, timeout=PATIENCE
    )
    if done.returncode != 0:
        raise InputError(f"a command failed: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    rows = done.stdout.splitlines()
    at = [n for n, row in enumerate(rows) if row.startswith(MARK)]
    walls = [begun, *(float(rows[n].split()[1]) for n in at)]
    # `times` says user and system time of the shell, and in the line below those of what it ran: 1m2.345s
    spent = [0.0, *(sum(_seconds(word) for row in rows[n + 1 : n + 3] for word in row.split()) for n in at)]
    return [(b - a, d - c) for (a, b), (c, d) in zip(itertools.pairwise(walls), itertools.pairwise(spent), strict=True)]


def _seconds(text: str) -> float:
    """Of `1m2.345s`."""
    minutes, seconds = text.removesuffix("s").split("m")
    return 60.0 * float(minutes) + float(seconds)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="A new user's way, command by command.")
    parser.add_argument("--write", action="store_true", help="put it on docs/install.md")
    parser.add_argument("--python", default=sys.executable, help="interpreter of the new environment (default: this)")
    asked = parser.parse_args()
    check_places(None, (PAGE,) if asked.write else ())
    section = measure(asked.python)
    print(section.markdown())
    if asked.write:
        save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), section))


if __name__ == "__main__":
    run(main)
