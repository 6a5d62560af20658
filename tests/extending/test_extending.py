"""The walks of docs/extending.md, taken in a copy of the package: blocks make its files, and their tests hold there."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from itertools import pairwise
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


def copied(folder: Path, *names: str) -> None:
    """The package, and further files of the repository, in a folder of their own."""
    shutil.copytree(ROOT / "otwarp", folder / "otwarp", ignore=shutil.ignore_patterns("__pycache__"))
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)


def blocks(title: str) -> list[Block]:
    return [Block(*found) for found in BLOCK.findall(WALKS[title])]


def its_test(title: str) -> str:
    """The file that a walk names as its test."""
    link = re.search(r" Test: \[.*\]\(\.\./(tests/extending/\w+\.py)\)\.$", WALKS[title], re.M)
    assert link, f"{title}: where its test is"
    return link[1]


def files_of(folder: Path) -> dict[str, bytes]:
    """The package in a folder: what each of its files holds."""
    files = (p for p in (folder / "otwarp").rglob("*") if p.is_file() and "__pycache__" not in p.parts)
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}


def make_schema(folder: Path) -> None:
    """`make schema` in a copy of the package."""
    run_in(folder, "otwarp.scene.schema")


def run_in(folder: Path, *command: str) -> None:
    """`python -m …` with the copy of the package in a folder."""
    here = {**os.environ, "PYTHONPATH": str(folder)}
    done = subprocess.run(
        [sys.executable, "-m", *command], cwd=folder, env=here, capture_output=True, text=True, timeout=1800
    )
    assert done.returncode == 0, f"{command}: {done.stdout[-4000:]}{done.stderr[-2000:]}"


@pytest.mark.parametrize("title", WALKS)
def test_a_walk_touches_the_files_it_says(title: str, tmp_path: Path):
    """Those that differ from the package as it was: by its blocks, and by what it says to run."""
    copied(tmp_path, "docs/scene.md")
    states = [files_of(tmp_path)]
    for block in blocks(title):
        block.put_into(tmp_path)
    states.append(files_of(tmp_path))
    if "`make schema`" in WALKS[title]:
        make_schema(tmp_path)
    states.append(files_of(tmp_path))
    counts = [sum(new.get(f) != old.get(f) for f in new | old) for old, new in pairwise(states)]
    said = [f"{n} {how}" for n, how in zip(counts, ("by hand", "by `make schema`"), strict=True) if n]
    stated = re.search(r"^Files of the package: (.*?)\. Test", WALKS[title], re.M)
    assert stated, "how many files a walk touches"
    assert stated[1] == (", ".join(said) or "0")


PACKAGES = {
    kept: [title for title in WALKS if kept == (not any(b.path.startswith("otwarp/") for b in blocks(title)))]
    for kept in (True, False)
}
"""The walks that leave the package as it is, and those that change it."""


@pytest.mark.parametrize("title", WALKS)
def test_a_walk_stands_on_its_own(title: str):
    """What it defines is used by no other that shares its copy, nor by its test: each would lead there alone."""
    made = set(re.findall(r"^(?:def|class) (\w+)", "\n".join(block.code for block in blocks(title)), re.M))
    assert made
    for other in next(titles for titles in PACKAGES.values() if title in titles):
        if other != title:
            text = WALKS[other] + (ROOT / its_test(other)).read_text(encoding="utf-8")
            assert not made & set(re.findall(r"\w+", text)), other


@pytest.mark.parametrize("kept", PACKAGES, ids=["as it is", "changed"])
def test_the_walks_lead_where_they_say(kept: bool, tmp_path: Path):
    """Those of a copy in one process: each by itself would load and compile anew what they share."""
    tests = [its_test(title) for title in PACKAGES[kept]]
    copied(tmp_path, "docs/scene.md", "tests/conftest.py", *tests)
    for title in PACKAGES[kept]:
        for block in blocks(title):
            block.put_into(tmp_path)
    if any("`make schema`" in WALKS[title] for title in PACKAGES[kept]):
        make_schema(tmp_path)
    run_in(tmp_path, "pytest", "-q", "-p", "no:cacheprovider", *tests)
