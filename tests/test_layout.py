"""Tests mirror the package, and each room says what lies in it: whoever opens a module knows where it is tested."""

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


def namesake(module: Path) -> Path:
    """Where a kernel module is tested: what stands in float64 for another module is tested beside that one."""
    place = module.relative_to(KERNELS)
    parts = place.parts[1:] if place.parts[0] == "float64" else place.parts
    return TESTS.joinpath("kernels", *parts[:-1], f"test_{parts[-1]}")


def test_every_kernel_module_has_its_namesake():
    modules = [m for m in sorted(KERNELS.rglob("*.py")) if m.stem != "__init__" and does_something(m)]
    assert len(modules) > 40
    missing = [str(m.relative_to(KERNELS)) for m in modules if not namesake(m).is_file()]
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
