"""Tests mirror the package, each room says what lies in it, and what a file keeps to itself nobody else names."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
PACKAGE = TESTS.parent / "otwarp"
KERNELS = PACKAGE / "kernels"


def does_something(module: Path) -> bool:
    """Whether a module holds functions, not only constants and the layout of data."""
    return any(isinstance(node, ast.FunctionDef) for node in ast.parse(module.read_text(encoding="utf-8")).body)


KERNEL_ROOMS = [KERNELS, *sorted(p for p in PACKAGE.glob("*/kernels") if p.is_dir())]
"""Where device code lies: the room of that name, and the inner rooms of that name."""

TOGETHER = {
    "operators/test_chain.py": [
        "features",
        "local_model",
        "motion",
        "orders",
        "paper_mode",
        "passivity",
        "safety",
        "velocity",
    ],
    "envs/test_batch.py": ["control", "rows", "starts"],
    "envs/test_terms.py": ["geometry", "judge", "terms"],
    "operators/test_hand.py": ["account", "ahead", "arm", "seen"],
}
"""Parts of one step whose twin is a whole: the servo's chain in Python, an operator's period; a period of control."""


def namesakes(module: Path) -> list[Path]:
    """Where a kernel module may be tested: what stands in float64 for another module is tested beside that one."""
    place = module.relative_to(PACKAGE).parts
    place = (place[0], *place[2:]) if place[1] == "float64" else place
    mine = [TESTS.joinpath(*place[:-1], f"test_{place[-1]}")]
    if place[0] != "kernels":
        mine += [TESTS / place[0] / f"test_{place[-1]}"]
        mine += [TESTS / test for test, parts in TOGETHER.items() if module.stem in parts and test.startswith(place[0])]
    return mine


def test_every_kernel_module_has_its_namesake():
    for room in KERNEL_ROOMS:
        modules = [m for m in sorted(room.rglob("*.py")) if m.stem != "__init__" and does_something(m)]
        assert len(modules) > (40 if room == KERNELS else 1), room
        missing = [m.relative_to(PACKAGE).as_posix() for m in modules if not any(t.is_file() for t in namesakes(m))]
        assert missing == []


def rooms_within(folder: Path) -> set[str]:
    """Stems of the modules of a room, and names of its inner rooms."""
    return {p.stem for p in folder.glob("[!_]*.py")} | {p.parent.name for p in folder.glob("*/__init__.py")}


@pytest.mark.parametrize(
    "room", sorted(p.parent.relative_to(PACKAGE).as_posix() for p in PACKAGE.rglob("__init__.py") if p.stat().st_size)
)
def test_a_room_says_what_lies_in_it(room):
    """Its docstring names every file and inner room, and, where there are several, the one to open first."""
    plan = ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text(encoding="utf-8"))) or ""
    stems = rooms_within(PACKAGE / room)
    assert not [stem for stem in sorted(stems) if not re.search(rf"\b{stem}\b", plan)]
    assert len(stems) < 3 or re.search(r"\bopen\b", plan.lower()), "which file to open first?"


def private(name: object) -> bool:
    """Whether a name is one that a module or class keeps to itself."""
    return isinstance(name, str) and re.fullmatch(r"_(?!_)\w*[a-z]\w*", name) is not None


def own_names(nodes: list[ast.AST]) -> set[str]:
    """Private names that a module gives out itself: to its functions and classes, and to their attributes."""
    found = {n.name for n in nodes if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)}
    found |= {n.attr for n in nodes if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)}
    return found | {n.target.id for n in nodes if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}


def strangers(tree: ast.Module) -> list[str]:
    """Private names of others that a module uses: `a._b`, `getattr(a, "_b")`, `from a import _b`."""
    nodes = list(ast.walk(tree))
    own, found = own_names(nodes), []
    for node in nodes:
        if isinstance(node, ast.Attribute) and private(node.attr):
            mine = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
            if not (mine and isinstance(node.ctx, ast.Store)) and node.attr not in own:
                found.append(node.attr)
        elif isinstance(node, ast.ImportFrom):
            parts = [*(node.module or "").split("."), *(a.name for a in node.names)]
            found += [part for part in parts if private(part)]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in BY_NAME:
            named = node.args[1].value if isinstance(node.args[1], ast.Constant) else None
            found += [str(named)] if private(named) and named not in own else []
    return found


BY_NAME = {"getattr", "setattr", "hasattr", "delattr"}
LEAVING = {"_exit"}
"""`os._exit` is public: how a process ends at once."""


def test_private_names_are_used_where_they_are_given_alone():
    """What must reach into a library stands in a file of its own, `<library>_internals.py`, with a test of its own."""
    reaching = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        names = set(strangers(ast.parse(path.read_text(encoding="utf-8")))) - LEAVING
        if names and not path.stem.endswith("_internals"):
            reaching[path.relative_to(PACKAGE).as_posix()] = names
    assert not reaching


def test_what_reaches_into_a_library_has_a_test_of_its_own():
    files = sorted(PACKAGE.rglob("*_internals.py"))
    assert len(files) > 2
    tests = {p.stem for p in TESTS.rglob("test_*_internals.py")}
    assert not [path for path in files if f"test_{path.stem}" not in tests]
    assert not [
        path
        for path in files
        if not re.search("Seen in|Made for", ast.get_docstring(ast.parse(path.read_text())) or "")
    ]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("from a import _b", ["_b"]),
        ("from a._b import c", ["_b"]),
        ("def f(thing): return thing._b", ["_b"]),
        ("def f(thing): return getattr(thing, '_b')", ["_b"]),
        ("class A:\n  def __init__(self): self._b = 1\n  def like(self, other): return self._b == other._b", []),
        ("class A(B):\n  def f(self): return self._of_b", ["_of_b"]),
    ],
)
def test_names_of_others_are_found(text, names):
    assert strangers(ast.parse(text)) == names
