"""Lists of commands on the pages: each runs as it stands, or is one of those that say here why not."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from docs.building.blocks import OTHERS, PAGES, at_work
from tests.documents import ROOT

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"(otwarp|python|make) ")
LEFT = {
    r"make |python (-m (benchmarks|pytest)|examples/train)": "what CI and benchmarks are for",
    r"otwarp (teleop|view|edit|ros1|envs play)": "goes on until somebody ends it; tests/view and tests/teleop do",
    r"cuda:0": "a GPU",
    r"otwarp (bench|reproduce --out|operators (run|sweep)|haptics check( --(device|scene)|  ))": "minutes",
    r"otwarp study (run studies/(transport|delivery|robot_hold|escape)|show out/escape)": "minutes; shipped_studies",
    r"otwarp study run .*--engine ray": "many cores; tests/studies/test_engines.py",
    r"otwarp (haptics replay|operators show)": "reads what a line above it would have made",
    r"otwarp vision (dataset|train|(track|find) .*--net )": "minutes, and what these make; tests/vision",
    r"otwarp vision track .*--every 6 ": "minutes; the README has it with fewer frames",
    r"my_chip|SCENE": "a name that readers fill in",
}
BEFORE = {"README": ["otwarp run scenes/strategy_a.usda --out out/pair"]}
"""What the comment of a line asks for, by page."""
SOLIDS = {"part.stl": 4.0, "pillar.stl": 4.0, "chip.stl": 0.05}
"""Meshes that the pages name, and half the side of each in its own unit [µm, µm, mm]."""


def commands(page: Path) -> list[str]:
    """Lines of the page's lists that are commands, comments left out."""
    blocks = FENCE.findall(page.read_text(encoding="utf-8"))
    text = "".join(block for language, block in blocks if not language)
    lines = [line.split("   #")[0].split(" # ")[0].strip() for line in text.splitlines()]
    return [line for line in lines if COMMAND.match(line)]


def runs(line: str) -> bool:
    """Whether a command runs here."""
    return not any(re.search(pattern, line + "  ") for pattern in LEFT)


PAGES_WITH = [page for page in sorted({*PAGES, *OTHERS}) if any(runs(line) for line in commands(page))]


@pytest.mark.parametrize("page", PAGES_WITH, ids=lambda page: page.stem)
def test_the_commands_of_a_page_run(page: Path, tmp_path: Path):
    trimesh = pytest.importorskip("trimesh")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    with at_work(tmp_path):
        for name, half in SOLIDS.items():
            trimesh.creation.box([2.0 * half] * 3).export(tmp_path / name)
        for line in [*BEFORE.get(page.stem, ()), *filter(runs, commands(page))]:
            words = shlex.split(line.split(" > ")[0])
            done = subprocess.run([sys.executable, "-m", *words] if words[0] == "otwarp" else words, env=environment,
                                  capture_output=True, text=True, check=False)  # fmt: skip
            assert done.returncode == 0, f"{line}\n{done.stderr}"


@pytest.mark.quick
def test_what_is_left_out_is_there():
    lines = [line + "  " for page in {*PAGES, *OTHERS} for line in commands(page)]
    assert sum(map(runs, lines)) >= 25
    assert [pattern for pattern in LEFT if not any(re.search(pattern, line) for line in lines)] == []
