"""What options of several benchmarks are checked for."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from otwarp.errors import InputError


def check_names(option: str, names: Iterable[str], known: Collection[str]) -> None:
    """Raise `InputError` for a name that an option does not know."""
    for name in names:
        if name not in known:
            raise InputError(f"{option} is {name!r}; allowed: {', '.join(known)}")


def check_least(option: str, value: int | None, least: int) -> None:
    """Raise `InputError` for a number that is given and too small."""
    if value is not None and value < least:
        raise InputError(f"{option} is {value}; allowed: {least} or more")
