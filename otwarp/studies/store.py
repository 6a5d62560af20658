"""A study on disk: zarr arrays with the dimensions of its axes, and a marker for every block that is whole.

    out/capture/
        study.json     what was asked, with digests, versions and seed: written first, never changed
        study.toml     the text of its file, if it had one; sources/ holds those of functions of one's own
        scene.usda     the scene, flattened
        results.zarr   zarr v3: coordinates, trials, outcomes; one block of points is one chunk of every array
        done/000012    written when all chunks of block 12 are; says which versions computed it

A block is written by one task, and depends on nothing but the study: it may be computed twice, by anyone, in any order.
What is not marked as done is not there, whatever its chunks hold: a block may have been cut off between two arrays, or
may be read between them. Nor is a block whose outcomes a copy of the folder has lost. Of a study with a budget, whose
blocks grow, `trials` says what is there: it is written last.
The folder appears as a whole, so that a hundred shards may begin at once: the first makes it, the others find it.
"""

from __future__ import annotations

import contextlib
import functools
import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import check_place, claimed, written
from otwarp.studies.damage import WHOLE, grid_of, named_damage, with_outcomes
from otwarp.studies.differences import difference, short

VERSION = 1
"""Of the layout of the folder."""

RULES = 2
"""Of what a study draws and how many trials its points get, where its file does not say so: raised when that changes.

1, or nothing in the folder: normal scatter without bounds, a Sobol sequence for each name, contours by sequences.
2: scatter within four deviations, one sequence for names that go together, contours by looks.
"""


@functools.cache  # a mark of each block says them, and looking them up reads files
def versions() -> dict[str, str]:
    """What must be alike for bits to be alike, on one kind of device."""
    import warp

    import otwarp

    return {"otwarp": otwarp.__version__, "warp": warp.__version__, "numpy": np.__version__}


_KINDS = {"scene": dict, "observables": list, "stop": dict, "blocks": int, "axes": dict, "versions": dict}
"""What `study.json` must say, and of what kind it is in JSON."""

_LATER = ("axes", "versions")
"""What the files of the first studies do not say."""

FILL = {"i": -1, "f": np.nan, "U": "", "b": False}


@dataclass(frozen=True)
class Variable:
    """An array of results.

    Attributes:
        dims: Its dimensions.
        dtype: Of its numbers.
        fill: What stands where nothing was computed.
        attrs: Units and descriptions.
    """

    dims: tuple[str, ...]
    dtype: str
    fill: Any
    attrs: Mapping[str, str]


@dataclass(frozen=True)
class Store:
    """The folder of a study; made by `engines.create` or found by `open_store`."""

    folder: Path

    @property
    def results(self) -> Path:
        """Folder of the zarr group that holds the results."""
        return self.folder / "results.zarr"

    @property
    def scene(self) -> Path:
        """File of the flattened scene."""
        return self.folder / "scene.usda"

    def asked(self) -> dict[str, Any]:
        """What `study.json` says.

        Raises:
            InputError: It is not there, or not readable.
        """
        file = self.folder / "study.json"
        try:
            said = json.loads(file.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise InputError(
                f"{self.folder}: holds no study; allowed: a folder that otwarp study run has made"
            ) from None
        except (OSError, ValueError) as error:
            raise InputError(
                f"{file}: cannot be read ({error}); allowed: the file that otwarp study run wrote"
            ) from None
        if not isinstance(said, dict) or "version" not in said:
            raise InputError(f"{file}: holds {short(said)}; allowed: the file that otwarp study run wrote")
        if said["version"] != VERSION:
            raise InputError(f"{file}: version = {said.get('version')!r}: must be {VERSION}, as this otwarp writes it")
        for name, kind in _KINDS.items():
            if name not in said and name not in _LATER:
                raise InputError(f"{file}: has no {name}; allowed: the file that otwarp study run wrote")
            if name in said and type(said[name]) is not kind:
                raise InputError(f"{file}: {name} = {short(said[name])}; allowed: the file that otwarp study run wrote")
        return said

    def cut(self) -> tuple[int, ...]:
        """Points of a block along each dimension: a folder keeps the blocks that it was made with.

        Raises:
            InputError: The results are not there.
        """
        return tuple(self._arrays["trials"].chunks)

    def done(self, block: int) -> bool:
        """Whether a block is whole."""
        return self._marker(block).is_file() and bool(with_outcomes(self.results, [block]))

    def finished(self) -> list[int]:
        """Blocks that are whole: marked, and their outcomes have not been lost since.

        Raises:
            InputError: Results that are not there, or damaged.
        """
        folder = self.folder / "done"
        marked = [f for f in folder.iterdir() if f.name.isdigit() and f.is_file()] if folder.is_dir() else []
        return with_outcomes(self.results, sorted(int(f.name) for f in marked)) if marked else []

    def _marker(self, block: int) -> Path:
        return self.folder / "done" / f"{block:06d}"

    @functools.cached_property
    def _arrays(self) -> Any:
        """By name the arrays of results, opened once.

        Raises:
            InputError: They are not there.
        """
        import zarr

        self._check_results()
        with named_damage(self.results):
            return dict(zarr.open_group(str(self.results), mode="r+").arrays())

    def _check_results(self) -> None:
        if not (self.results / "zarr.json").is_file():
            raise InputError(f"{self.results}: is not there; allowed: the folder as otwarp study run made it, "
                             "or a new one")  # fmt: skip

    def check_writable(self) -> None:
        """Find out before anything is computed whether blocks can be kept.

        Raises:
            InputError: They cannot.
        """
        if self.folder.is_dir():  # copies may leave out what is empty
            with contextlib.suppress(OSError):
                (self.folder / "done").mkdir(exist_ok=True)
        for folder in (self.folder, self.folder / "done"):
            check_place(folder, "the folder of the study", folder=True)

    def write(self, blocks: Sequence[int], where: tuple[slice, ...], arrays: Mapping[str, np.ndarray]) -> None:
        """Write whole blocks, the number of their trials behind what they count, and their markers last.

        Args:
            blocks: Their numbers.
            where: Their points, all of them, a slice per dimension.
            arrays: By the names of `Study.variables`.

        Raises:
            OSError: The disk is full, or the folder has gone; it names a file.
        """
        with self._named_errors():
            self._check_there()
            for name in sorted(arrays, key="trials".__eq__):
                self._put(name, where, arrays[name])
        for block in blocks:
            self.mark(block)

    def add(self, where: tuple[slice, ...], arrays: Mapping[str, np.ndarray], before: np.ndarray) -> None:
        """Write a block with more trials than it had, `before` (points of the block), the number of its trials last.

        Args:
            where: The block.
            arrays: Of trials, up to the most that a point has now; those from `before` on count.
            before: As many are there already.

        Raises:
            OSError: As `write`.
        """
        with self._named_errors():
            self._check_there()
            for name, values in arrays.items():
                if name != "trials":
                    kept = self.block(name, where)
                    width = values.shape[-1]
                    new = np.arange(width) >= before[..., None]
                    kept[..., :width] = np.where(new, values, kept[..., :width])
                    self._put(name, where, kept)
            self._put("trials", where, np.maximum(arrays["trials"], self.block("trials", where)))

    def block(self, name: str, where: tuple[slice, ...]) -> np.ndarray:
        """The array of a `name` in the block whose points are `where`, a slice per dimension."""
        return np.asarray(self._arrays[name][(*where, ...)])

    def trials(self) -> np.ndarray:
        """Trials of all points so far, −1 where none is."""
        return np.asarray(self._arrays["trials"][...])

    def mark(self, block: int) -> None:
        """Say that a block is whole.

        Raises:
            OSError: As `write`.
        """
        with self._named_errors(), written(self._marker(block)) as part:
            part.write_text(json.dumps(versions()) + "\n", encoding="utf-8")

    def _check_there(self) -> None:
        """Raise if the results have gone since they were opened: zarr would make their folders anew, but no arrays."""
        (self.results / "zarr.json").stat()

    def _put(self, name: str, where: tuple[slice, ...], values: np.ndarray) -> None:
        self._arrays[name][(*where, ...)] = values

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        """Errors of a disk that name a file."""
        try:
            yield
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(error.filename or self.results)) from error

    def read(self) -> Any:
        """All arrays as an `xarray.Dataset`, read when they are used; `trials` at once, −1 where a block is not whole.

        Raises:
            InputError: They are not there, or damaged.
        """
        import xarray

        self._check_results()
        done = self.finished()  # before anything else, as others may be writing
        with named_damage(self.results):
            found = xarray.open_zarr(str(self.results), consolidated=False, chunks=None)
            self._check_arrays(found)
            trials = found["trials"].load()
        if self.asked()["stop"].get("budget") is None:
            whole = _points_of(done, trials.shape, trials.encoding["chunks"])
            trials.values = np.where(whole, trials.values, FILL["i"]).astype(trials.dtype)
        else:
            self._check_outcomes(trials.values)
        return found

    @contextmanager
    def reading(self) -> Iterator[Any]:
        """As `read`, while the block lasts, in which what cannot be read is told by its file.

        Raises:
            InputError: As `read`.
        """
        with named_damage(self.results), self.read() as found:
            yield found

    def _check_outcomes(self, trials: np.ndarray) -> None:
        """Refuse results whose trials are counted, of which there are no outcomes."""
        blocks = range(int(np.prod(grid_of(self.results), dtype=np.int64)))
        there = with_outcomes(self.results, blocks)
        if np.any(trials[~_points_of(there, trials.shape, self.cut())] > 0):
            raise InputError(f"{self.results / 'end'}: outcomes of {len(blocks) - len(there)} of {len(blocks)} blocks "
                             f"are not there; {WHOLE}")  # fmt: skip

    def _check_arrays(self, found: Any) -> None:
        """Refuse results that have lost an array of all studies, or the values along an axis, as numbers or places."""
        for name in ("trials", "end", *self.asked().get("axes", {})):
            if name not in found.variables and f"{name}_x" not in found.variables:
                raise InputError(f"{self.results / name}: is not there; {WHOLE}")

    def claimed(self) -> AbstractContextManager[None]:
        """Hold the folder against a second driver on this machine; shards claim nothing, they share no block.

        Raises:
            InputError: Another process has it.
        """
        return claimed(self.folder, "runs this study; allowed: one driver, or --shard for several")


def _points_of(blocks: Sequence[int], shape: tuple[int, ...], chunk: tuple[int, ...]) -> np.ndarray:
    """Whether points belong to one of some blocks, which are the chunks of a grid in their order."""
    grid = tuple(-(-n // c) for n, c in zip(shape, chunk, strict=True))
    chosen = np.zeros(grid, dtype=bool)
    known = [b for b in blocks if b < chosen.size]
    chosen.reshape(-1)[known] = True
    return chosen[np.ix_(*(np.arange(n) // c for n, c in zip(shape, chunk, strict=True)))] if shape else chosen


def open_store(folder: Path) -> Store:
    """The study that a `folder` holds.

    Raises:
        InputError: It is none.
    """
    store = Store(folder)
    store.asked()
    return store


def check_same(store: Store, asked: Mapping[str, Any]) -> None:
    """Refuse to go on with another study than the one that the folder holds, or one that was begun by other rules.

    Raises:
        InputError: They differ; the message says in what.
    """
    begun = store.asked().get("rules", 1)
    if begun != RULES:
        raise InputError(f"{store.folder}: was begun by version {short(begun)} of the rules of studies, this otwarp "
                         f"has version {RULES}; allowed: the otwarp that began it, or a new folder")  # fmt: skip
    there, here = (json.loads(json.dumps(said)) for said in (store.asked(), asked))
    for said in (there, here):  # where the scene lies does not matter, what it says does
        said.get("scene", {}).pop("file", None)
        said.pop("versions", None)
    found = difference(there, here)
    if found is not None:
        where, a, b = found
        raise InputError(f"{store.folder}: holds a study with another {where}: {a} there, {b} now; "
                         "allowed: the same study, or a new folder")  # fmt: skip


def check_versions(store: Store, *, allowed: bool) -> None:
    """Refuse to compute blocks beside those of other versions, whose bits may differ; Python's own does not matter.

    Args:
        store: Of the study.
        allowed: Whether to say so and go on; each block keeps which versions computed it.

    Raises:
        InputError: They differ, and it is not allowed.
    """
    made, now = store.asked().get("versions", {}), versions()
    other = [name for name in now if name in made and made[name] != now[name]]  # older folders do not say NumPy's
    if not other:
        return
    what = ", ".join(f"{name} {made[name]}, {now[name]} now" for name in other)
    if not allowed:
        raise InputError(f"{store.folder}: was begun with {what}; allowed: the same, a new folder, or --allow-version: "
                         "blocks may then differ in their last bits from those that are there")  # fmt: skip
    warnings.warn(f"{store.folder}: was begun with {what}; blocks may differ in their last bits", stacklevel=2)
