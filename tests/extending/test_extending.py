"""The walks of docs/extending.md, taken in a copy of the package: blocks make its files, and their tests hold there."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from otwarp.kernels.contact import obstacles
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.kernels.optics.traps import AUTHORED
from otwarp.laws.trap_law import MODELS
from otwarp.scene import OPTICAL_MODELS, obstacle_shapes, vocabulary
from tests.documents import ROOT

PAGES = [(ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("extending.md", "haptics_devices_own.md")]
PLACE = r"new file|at the end|(?:behind|before|instead of): [^\n]*"
BLOCK = re.compile(rf"^```py\n# (\S+), ({PLACE})\n(.*?)^```$", re.M | re.S)
"""A block of code that says where it goes, and beside which line of that file."""


class Block(NamedTuple):
    path: str
    where: str
    code: str

    def put_into(self, folder: Path) -> None:
        """Make the change in a copy of the package; a line that it refers to stands there once."""
        file = folder / self.path
        if self.where == "new file":
            assert not file.exists(), self.path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(self.code, encoding="utf-8")
            return
        text = file.read_text(encoding="utf-8")
        if self.where == "at the end":
            file.write_text(f"{text}\n\n{self.code}", encoding="utf-8")
            return
        how, line = self.where.split(": ", 1)
        found = [entry for entry in text.splitlines(keepends=True) if entry.strip() == line]
        assert len(found) == 1, f"{self.path} has {line!r} {len(found)} times"
        after = {"behind": found[0] + self.code, "before": self.code + found[0], "instead of": self.code}[how]
        file.write_text(text.replace(found[0], after), encoding="utf-8")


WALKS = {
    title: body
    for page in PAGES
    for title, body in re.findall(r"^## ([^\n]+)\n(.*?)(?=^## |\Z)", page, re.M | re.S)
    if "```py" in body
}


def test_the_vocabulary_says_what_the_tables_have():
    """The scene room imports no kernels, so its words are written out."""
    assert vocabulary.TRAP["model"].allowed == (*AUTHORED, *OPTICAL_MODELS)
    assert set(MODELS) <= set(AUTHORED)
    assert vocabulary.SCENE["settings.integrator"].allowed == tuple(INTEGRATORS)
    assert obstacle_shapes.SHAPES.keys() == obstacles.SHAPES.keys()


def test_every_block_has_its_place():
    written = sum(page.count("```py\n") for page in PAGES)
    assert written == sum(len(BLOCK.findall(body)) for body in WALKS.values())


@pytest.mark.parametrize("title", WALKS)
def test_a_walk_leads_where_it_says(title: str, tmp_path: Path):
    body = WALKS[title]
    shutil.copytree(ROOT / "otwarp", tmp_path / "otwarp", ignore=shutil.ignore_patterns("__pycache__"))
    link = re.search(r" Test: \[.*\]\(\.\./(tests/extending/\w+\.py)\)\.$", body, re.M)
    assert link, "where its test is"
    for name in ("docs/scene.md", "tests/conftest.py", link[1]):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    blocks = [Block(*found) for found in BLOCK.findall(body)]
    for block in blocks:
        block.put_into(tmp_path)
    touched = {block.path for block in blocks if block.path.startswith("otwarp/")}
    stated = re.search(r"^Files of the package: (\d)", body, re.M)
    assert stated, "how many files a walk touches"
    assert len(touched) == int(stated[1]), sorted(touched)
    run = [[sys.executable, "-m", "otwarp.scene.schema"]] if "`make schema`" in body else []
    here = {**os.environ, "PYTHONPATH": str(tmp_path)}
    for command in [*run, [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", link[1]]]:
        done = subprocess.run(command, cwd=tmp_path, env=here, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, f"{title}: {done.stdout[-4000:]}{done.stderr[-2000:]}"
