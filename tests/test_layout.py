"""Tests mirror the package: whoever opens a kernel module knows where it is tested."""

from __future__ import annotations

import ast
from pathlib import Path

TESTS = Path(__file__).resolve().parent
KERNELS = TESTS.parent / "otwarp" / "kernels"


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
