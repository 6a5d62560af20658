"""An installed otwarp is whole: a wheel, unpacked far from the source, runs every command.

Everything runs in one interpreter that cannot see the source tree, and kernels come from the cache that all tests
share.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from otwarp.shipped import ENDINGS
from tests.test_import_rules import ADAPTERS

pytest.importorskip("setuptools", minversion="77", reason="the wheel needs setuptools as in the extra `dev`")
pytest.importorskip("setuptools_scm", reason="the version is that of the last tag")

ROOT = Path(__file__).resolve().parent.parent

OUTSIDE = """
import importlib.abc, sys
from pathlib import Path

site = Path(sys.argv[1])

def holds_source(entry):
    return Path(entry or ".").resolve() != site and (Path(entry or ".") / "otwarp").is_dir()

class NoneOfTheRepository(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("benchmarks", "tests", "scenes"):
            raise AssertionError(f"{name} is imported, and no installed otwarp has it")

sys.path[:] = [entry for entry in sys.path if not holds_source(entry)]
sys.meta_path[:] = [NoneOfTheRepository(), *(f for f in sys.meta_path if "editable" not in repr(f).lower())]
import otwarp
assert Path(otwarp.__file__).is_relative_to(site), otwarp.__file__
"""
"""Head of a script whose first argument is where the wheel was unpacked."""

HELPS = """
import click
from otwarp.cli.main import main
import otwarp.cli.main as cli

def tree(command, names):
    yield names
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            yield from tree(command.get_command(context, name), [*names, name])

group = next(v for v in vars(cli).values() if isinstance(v, click.Group))
for names in tree(group, []):
    print("help of", *names, flush=True)
    assert main([*names, "--help"]) == 0, names
"""

RUNS = """
import json, traceback
from otwarp.cli.main import main

for arguments in json.loads(sys.argv[2]):
    print("run", json.dumps(arguments), file=sys.stderr, flush=True)
    code = main(arguments)
    assert code == 0, (arguments, code)
"""

IMPORTS = """
from importlib import import_module

for name in sys.argv[3:]:
    try:
        import_module(name)
    except ModuleNotFoundError as error:
        # made of packages that only who wants it installs; CI has them all
        if name not in sys.argv[2].split() or error.name.split(".")[0] == "otwarp":
            raise
"""

CPU = ["--device", "cpu"]
ONCE = ["--rounds", "1", *CPU]
BEAD = ["--radius", "0.5", "--worlds", "8", *ONCE]
COMMANDS: dict[str, list[str]] = {
    "scenes list": [],
    "scenes copy": ["capture"],
    "new": ["chamber", "mine.usda"],
    "import": ["cube.stl", "--into", "mine.usda", "--position", "0,30,0"],
    "info": ["bead.usda", *CPU],
    "validate": ["scenes/cell_delivery.usda"],
    "study plan": ["capture.toml", *CPU],
    "run": ["single_bead", "--out", "out", "--duration", "0.05", "--forces", *CPU],
    "preview": ["out", "-o", "frame.png", "--size", "64x48", *CPU],
    "forces": ["--radius", "0.5", "--index", "1.59", "--curves"],
    "mobility": ["bead.usda"],
    "decompose": ["cube.stl", "-n", "1", "-o", "cube.usda"],
    "bench me": ["single_bead", "--seconds", "0.01", *ONCE],
    "bench forces": ["--model", "bilinear-1e-2", *BEAD],
    "bench integrators": ["--seconds", "0.01", "--axis", "precision", *BEAD],
    "bench speed": ["--case", "bead", "--case", "delivery", "--seconds", "1e-4", "--scale", "0.001", *ONCE],
    "bench stability": ["--quick", "--grid", "drag", *CPU],
    "bench terms": ["--term", "gravity", "--seconds", "1e-4", "--bodies", "64", *ONCE],
    "haptics config": [],
    "haptics check": ["--seconds", "0.05", "--no-width", "--no-page"],
    "teleop": ["teleop.usda", "--no-page", "--no-open", "--duration", "0.2", "--record", "take.mcap", "--arm",
               "--left", "virtual:circle,radius=0.005", "--right", "virtual:hold,at=0/0/0", *CPU],
    "haptics replay": ["take.mcap"],
}  # fmt: skip
"""One quick run of each command; `ros1` and `ros2` need a network, and tests of their own have one."""

CORNERS = [(x, y, z) for x in (0, 2) for y in (0, 2) for z in (0, 2)]
FACES = [(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2),
         (1, 3, 7), (1, 7, 5)]  # fmt: skip


def cube() -> str:
    """A cube of 2 as STL text; faces run outward."""
    faces = []
    for face in FACES:
        corners = "".join("vertex {} {} {}\n".format(*CORNERS[corner]) for corner in reversed(face))
        faces.append(f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    return f"solid cube\n{''.join(faces)}endsolid cube\n"


def arguments(name: str) -> list[str]:
    """What is typed after `otwarp`; benchmarks write their numbers as well."""
    words = name.split()
    return [*words, *COMMANDS[name], *(["-o", f"{words[1]}.json"] if words[0] == "bench" else [])]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """A wheel, built without a network from a copy: building writes beside the source."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    for name in ("otwarp", *ENDINGS):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("author", "__pycache__"))
    build = f"from setuptools import build_meta; build_meta.build_wheel({str(out)!r})"
    done = subprocess.run([sys.executable, "-c", build], cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (file,) = out.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def site(wheel, tmp_path_factory) -> Path:
    """The wheel unpacked, as an installation has it."""
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory) -> Path:
    """A user's folder, with scenes of his own."""
    folder = tmp_path_factory.mktemp("elsewhere")
    shutil.copy(ROOT / "scenes" / "single_bead.usda", folder / "bead.usda")
    shutil.copy(ROOT / "scenes" / "teleop_small.usda", folder / "teleop.usda")
    (folder / "cube.stl").write_text(cube())
    return folder


def run(site: Path, folder: Path, script: str, *words: str) -> str:
    """What a script that knows only the installed package prints, and what it says on the way."""
    paths = {"PYTHONPATH": str(site), "OTWARP_CACHE": str(folder / "tables")}
    command = [sys.executable, "-c", OUTSIDE + script, str(site), *words]
    done = subprocess.run(command, cwd=folder, env=os.environ | paths, capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stdout[-1000:]}\n{done.stderr[-3000:]}"
    return done.stdout + done.stderr


@pytest.mark.quick
def test_data_files_are_in_the_wheel(site):
    for folder in ("scene/schema", "operators"):
        here = {p.name for p in (ROOT / "otwarp" / folder).iterdir() if p.suffix not in (".py", "") and p.is_file()}
        there = {p.name: p for p in (site / "otwarp" / folder).iterdir()}
        assert here and here <= set(there)
        for name in here:
            assert there[name].read_bytes() == (ROOT / "otwarp" / folder / name).read_bytes()
    for kind, ending in ENDINGS.items():
        for file in (ROOT / kind).glob(f"*{ending}"):
            assert (site / "otwarp" / "shipped" / kind / file.name).read_bytes() == file.read_bytes(), file
    data = [p for p in (ROOT / "otwarp").rglob("*") if p.is_file() and p.suffix not in (".py", ".pyc")]
    assert all((site / "otwarp" / p.relative_to(ROOT / "otwarp")).is_file() for p in data), "package-data lacks some"


@pytest.mark.quick
def test_every_module_is_in_the_wheel_and_nothing_of_the_repository(site):
    modules = {p.relative_to(ROOT) for p in (ROOT / "otwarp").rglob("*.py")}
    assert {p.relative_to(site) for p in (site / "otwarp").rglob("*.py")} == modules
    assert {p.name for p in site.iterdir() if p.suffix != ".dist-info"} == {"otwarp"}


@pytest.mark.quick
def test_every_command_helps(site, elsewhere):
    out = run(site, elsewhere, HELPS)
    for name in (*COMMANDS, "ros1", "ros2"):
        assert f"help of {name}\n" in out


def test_every_module_is_imported(site, elsewhere):
    """None of them asks for the repository; what functions import is in `tests/test_import_rules.py`."""
    modules = sorted(p.relative_to(site).with_suffix("") for p in (site / "otwarp").rglob("*.py"))
    names = [".".join(m.parts).removesuffix(".__init__") for m in modules if m.name != "__main__"]
    adapters = " ".join(file.removesuffix(".py").replace("/", ".") for file in ADAPTERS)
    run(site, elsewhere, IMPORTS, adapters, *names)


def test_every_command_runs(site, elsewhere):
    out = run(site, elsewhere, RUNS, json.dumps([arguments(name) for name in COMMANDS]))
    assert "cell delivery, 1 world" in out and "NumPy" in out and "Cost of each term" in out
    for name in ("me", "forces", "integrators", "speed", "stability", "terms"):
        assert json.loads((elsewhere / f"{name}.json").read_text()), name
    for file in ("out/run.usda", "frame.png", "cube.usda", "take.mcap"):
        assert (elsewhere / file).exists(), file
