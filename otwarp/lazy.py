"""Packages that offer the names of their files, each file loaded when one of its names is first used."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_names(
    package: str, homes: Mapping[str, tuple[str, ...]], *, rooms: tuple[str, ...] = ()
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package whose names live in its files.

    Args:
        package: Its `__name__`.
        homes: File, relative to the package, and the names that it holds. No name is also that of a file, which an
            import of the file would put in its place.
        rooms: Packages within it that are reached as attributes too.
    """
    home_of = {name: f"{package}.{file}" for file, names in homes.items() for name in names}

    def __getattr__(name: str) -> Any:
        if name in rooms:
            return import_module(f"{package}.{name}")
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(home_of[name]), name)

    def __dir__() -> list[str]:
        return sorted({*home_of, *rooms})

    return __getattr__, __dir__
