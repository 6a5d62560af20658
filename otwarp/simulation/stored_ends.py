"""Ends of worlds in checkpoints: their functions by name and digest, their parameters as they were given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.kernels.core.functions import digest_of
from otwarp.simulation.ends import End, escaped, reached, strayed, timed_out

SHIPPED = {end.name: end for end in (escaped, reached, strayed, timed_out)}
"""Those that need not be given again."""


def digest(end: End) -> str:
    """SHA-256 of an end's function, of the functions and constants it uses, and of the types of its parameters."""
    return digest_of(end.predicate.function, end.name, end.predicate.kinds)


def described(ends: Sequence[End] | None) -> list[dict[str, str]] | None:
    """Names and digests of the ends of a simulation, for a checkpoint; None where it has none."""
    return None if ends is None else [{"name": end.name, "digest": digest(end)} for end in ends]


def values(ends: Sequence[End] | None) -> dict[str, np.ndarray]:
    """The parameters of all ends, by names of arrays of a checkpoint."""
    return {
        f"end.{n}.{k}": np.asarray(v, dtype=float) for n, end in enumerate(ends or ()) for k, v in end.values.items()
    }


def check_same(path: Path, what: str, given: str, stored: str) -> None:
    """Refuse another function than the one that a checkpoint was made with, by their digests.

    Raises:
        InputError: They differ; `what` is the function.
    """
    if given != stored:
        raise InputError(
            f"checkpoint {path}: {what} is another function than the one it was made with "
            f"(SHA-256 {stored[:12]}…); allowed: the same source and constants"
        )


def restored(
    path: Path, stored: list[dict[str, str]] | None, arrays: Mapping[str, np.ndarray], given: Sequence[End] | None
) -> tuple[End, ...] | None:
    """The ends of a checkpoint, with the functions that are given or shipped.

    Args:
        path: The checkpoint.
        stored: What it says of them.
        arrays: All that it holds.
        given: Ends whose functions it may have, in any order.

    Raises:
        InputError: One is missing, too many, or another function than the checkpoint's.
    """
    names = [entry["name"] for entry in stored or ()]
    functions = {end.name: end for end in given or ()}
    if (stored is None and given is not None) or set(functions) - set(names):
        made = "without ends" if stored is None else f"with ends: {', '.join(names) or 'none'}"
        raise InputError(f"checkpoint {path} was made {made}; given: {', '.join(functions) or 'an empty list'}")
    if stored is None:
        return None
    ends = []
    for n, entry in enumerate(stored):
        known: Any = functions.get(entry["name"], SHIPPED.get(entry["name"]))
        if known is None:
            raise InputError(f"checkpoint {path} was made with the end {entry['name']}; allowed: restore(…, ends=[…])")
        check_same(path, f"end {entry['name']}", digest(known), entry["digest"])
        ends.append(replace(known, values={k: arrays[f"end.{n}.{k}"] for k in known.values}))
    return tuple(ends)
