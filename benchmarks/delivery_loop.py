"""`python -m benchmarks.delivery_loop [--write]`: the cell delivery as the twin of a simulated laboratory's images.

The commands of docs/closed_loop.md, typed into one shell in an empty folder: images of a robot, a small network that
learns them, and a session with hands of a program that hold still. `--write` puts what they print onto that page.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.report import commit, run, save_page
from benchmarks.validation import put_on_page
from otwarp.bench.machine import Machine
from otwarp.device import pick_device
from otwarp.errors import InputError

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "closed_loop.md"
MARKS = "<!-- begin delivery -->", "<!-- end delivery -->"
SESSION = (
    "otwarp teleop scenes/cell_delivery.usda --camera top --perception out/vision/delivery_net "
    "--left virtual:hold,at=0/0/0 --right virtual:hold,at=0/0/0 --arm --no-page --duration 20"
)
COMMANDS = (
    "otwarp vision dataset vision/delivery.toml --out out/vision/delivery",
    "otwarp vision train out/vision/delivery --net small --heads pose --epochs 25 --batch 16 --lr 3e-3 "
    "--out out/vision/delivery_net",
    SESSION,
)
"""What is typed; the last one's output is shown."""

PATIENCE = 900.0
"""For each [s]."""

TOLD = re.compile(r"^(camera|templates|left|right|session|servo|latency| {2})")
"""Lines of the session that are shown: what it is fed by, what is seen and felt, and how late."""


def typed(command: str, folder: Path) -> tuple[str, float]:
    """What a command prints, and how long it takes [s].

    Raises:
        InputError: It fails.
    """
    words = [sys.executable, "-m", *shlex.split(command)]
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    begun = time.perf_counter()
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False,
                          env=os.environ | {"PYTHONPATH": paths})  # fmt: skip
    if done.returncode:
        raise InputError(f"{command} ends with {done.returncode}: {done.stderr.strip()[-300:]}")
    return done.stdout, time.perf_counter() - begun


def text() -> str:
    """All commands with what they took, and what the session printed."""
    machine, rows, printed = Machine.look(pick_device("cpu")), [], ""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in ("scenes", "vision"):
            (folder / part).symlink_to(ROOT / part)
        for command in COMMANDS:
            printed, took = typed(command, folder)
            rows.append(f"{command}   # {took:.0f} s")
    shown = [line for line in printed.splitlines() if TOLD.match(line)]
    code = f" Commit {known}." if (known := commit()) else ""
    head = f"`python -m benchmarks.delivery_loop` on {machine.text()}.{code}"
    return "\n".join([head, "", "```", *rows, "```", "", "```", *shown, "```"])


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="The cell delivery as the twin of a simulated laboratory's images.")
    parser.add_argument("--write", action="store_true", help="put it on docs/closed_loop.md")
    given = parser.parse_args()
    found = text()
    print(found)
    if given.write:
        save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), found, *MARKS))


if __name__ == "__main__":
    run(main)
