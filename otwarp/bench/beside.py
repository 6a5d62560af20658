"""Modules of the `benchmarks` folder that stands beside the package in a checkout; an installed otwarp has none."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

import otwarp

ROOT = Path(otwarp.__file__).resolve().parent.parent


def beside(name: str) -> ModuleType:
    """Import `benchmarks.<name>`.

    Raises:
        ImportError: This otwarp does not come from a checkout, or the module needs something that is not installed.
    """
    if not (ROOT / "benchmarks").is_dir():
        raise ImportError("the folder benchmarks/ of the source is not here")
    sys.path.insert(0, str(ROOT))
    try:
        return importlib.import_module(f"benchmarks.{name}")
    finally:
        sys.path.remove(str(ROOT))
