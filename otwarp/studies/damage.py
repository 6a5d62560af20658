"""What is missing or damaged in the results of a study, by its file: what a copy left out, or a disk has lost."""

from __future__ import annotations

import contextlib
import itertools
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError

WHOLE = "allowed: the folder as otwarp study run made it, or a new one"


def grid_of(results: Path) -> tuple[int, ...]:
    """Blocks along each dimension of the points, by what the array of trials says of itself.

    Raises:
        InputError: It is not there, or damaged.
    """
    file = results / "trials" / "zarr.json"
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
        shape, chunk = said["shape"], said["chunk_grid"]["configuration"]["chunk_shape"]
        return tuple(-(-n // c) for n, c in zip(shape, chunk, strict=True))
    except FileNotFoundError:
        raise InputError(f"{file}: is not there; {WHOLE}") from None
    except (OSError, ValueError, TypeError, KeyError, ZeroDivisionError) as error:
        raise InputError(f"{file}: is damaged ({_first(error)}); {WHOLE}") from None


def with_outcomes(results: Path, blocks: Iterable[int]) -> list[int]:
    """Those of some blocks whose chunk of ends is there: of computed trials it is never empty, so that zarr writes it.

    Raises:
        InputError: As `grid_of`.
    """
    grid = grid_of(results)
    count = int(np.prod(grid, dtype=np.int64))
    place = lambda n: "/".join(map(str, ("c", *map(int, np.unravel_index(n, grid)), 0))) if grid else "c/0"  # noqa: E731
    return [n for n in blocks if n < count and (results / "end" / place(n)).is_file()]


def check_times(results: Path, ended: np.ndarray, time: np.ndarray) -> None:
    """Refuse ends without a time: that is what the chunk of times reads as where it has been lost.

    Args:
        results: Of the study.
        ended: (…, trials) whether a trial has come to an end.
        time: Its time, NaN without one.

    Raises:
        InputError: Some have none.
    """
    without = ended & np.isnan(time)
    if np.any(without):
        raise InputError(f"{results / 'end_time'}: of {np.sum(without)} of {np.sum(ended)} trials that ended the time "
                         f"is not there; {WHOLE}")  # fmt: skip


@contextlib.contextmanager
def named_damage(results: Path) -> Iterator[None]:
    """What zarr cannot read, in one line that names the file.

    Raises:
        InputError: Instead of any error of zarr and its codecs.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if not _of_zarr(error):
            raise
        raise InputError(_found(results) or f"{results}: is damaged ({_first(error)}); {WHOLE}") from None


def _of_zarr(error: BaseException) -> bool:
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_globals.get("__name__", "").partition(".")[0] in ("zarr", "numcodecs"):
            return True
        trace = trace.tb_next
    return False


def _found(results: Path) -> str:
    """The first file of an array that cannot be read, and why; nothing where all can."""
    import zarr

    for about in sorted(results.glob("**/zarr.json")):
        try:
            array: Any = zarr.open(str(about.parent), mode="r")
        except Exception as error:
            return f"{about}: is damaged ({_first(error)}); {WHOLE}"
        if not isinstance(array, zarr.Array):
            continue
        grid = [range(-(-n // c)) for n, c in zip(array.shape, array.chunks, strict=True)]
        for place in itertools.product(*grid):
            try:
                array.blocks[place]
            except Exception as error:
                file = about.parent.joinpath("c", *map(str, place))
                return f"{file}: is damaged ({_first(error)}); {_again(results, place)}"
    return ""


def _again(results: Path, place: tuple[int, ...]) -> str:
    """What helps against a chunk that is damaged."""
    grid = grid_of(results)
    if len(place) < len(grid):
        return WHOLE
    block = int(np.ravel_multi_index(place[: len(grid)], grid)) if grid else 0
    mark = results.parent / "done" / f"{block:06d}"
    return f"allowed: as otwarp study run wrote it; where {mark} is removed, the same run computes the block again"


def _first(error: BaseException) -> str:
    """First line of what an error says."""
    return str(error).strip().partition("\n")[0] or type(error).__name__
