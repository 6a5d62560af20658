"""`open_dataset`: labels, splits and images of a data set, checked against its checksums when they are first read."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.datasets.splits import PARTS
from otwarp.vision.datasets.store import Store


class Dataset:
    """A finished data set; made by `open_dataset`.

    Attributes:
        folder: Where it is.
        manifest: What `manifest.json` says.
        labels: By name (n): see the card of the data set.
    """

    def __init__(self, store: Store, manifest: dict[str, Any], checksums: Mapping[str, str]):
        self.folder, self.manifest = store.folder, manifest
        self._store, self._checksums = store, checksums
        self._good: set[str] = set()
        self.labels: Mapping[str, np.ndarray] = {name: self._label(name) for name in manifest["labels"]}

    @property
    def count(self) -> int:
        """Number of images."""
        return int(self.manifest["count"])

    @property
    def shape(self) -> tuple[int, int]:
        """Of an image: height, width [pixels]."""
        height, width = self.manifest["shape"]
        return height, width

    @property
    def classes(self) -> np.ndarray:
        """(c) tilts of the classes [deg]."""
        return np.array(self.manifest["classes"], dtype=float)

    @property
    def robot(self) -> dict[str, Any]:
        """Its spheres and rods in its own frame, and that frame within the prim's."""
        return self.manifest["robot"]

    @property
    def splits(self) -> tuple[str, ...]:
        """Names of those that there are."""
        return tuple(self.manifest["splits_made"])

    def __len__(self) -> int:
        return self.count

    def images(self, which: slice | Sequence[int] | np.ndarray | int) -> np.ndarray:
        """(k, height, width) uint8, row 0 of an image the lowest; a chunk of the file is read once a call.

        Args:
            which: A slice, (k) numbers of images, or (n) booleans.

        Raises:
            InputError: No such image, or a file that is corrupt or lost.
        """
        rows = self._rows(which)
        chunk = int(self.manifest["chunk"])
        out = np.empty((len(rows), *self.shape), dtype=np.uint8)
        of, images = rows // chunk, self._images
        for number in np.unique(of):
            mine = of == number
            first = int(number) * chunk
            self._check(f"images/c/{number}/0/0")
            out[mine] = images[first : first + chunk][rows[mine] - first]
        return out

    def split(self, name: str) -> dict[str, np.ndarray]:
        """Numbers of the images that train, validate and test.

        Args:
            name: One of `splits`.

        Raises:
            InputError: No such split, or a part of it is empty.
        """
        if name not in self.splits:
            there = ", ".join(self.splits) or "none, the data set has no splits"
            raise InputError(f"split is {name!r}; allowed in {self.folder}: {there}")
        part = self.labels[f"split_{name}"]
        found = {what: np.flatnonzero(part == n) for n, what in enumerate(PARTS)}
        for what, rows in found.items():
            if not len(rows):
                raise InputError(f"{self.folder}: split {name} has no image for {what}; allowed: one or more")
        return found

    def verify(self) -> None:
        """Read everything, and compare it with the checksums.

        Raises:
            InputError: A file is corrupt or lost; it is named.
        """
        self._good.clear()
        for name in self._checksums:
            self._check(name)

    def _rows(self, which: Any) -> np.ndarray:
        if isinstance(which, slice):
            return np.arange(*which.indices(self.count))
        rows = np.atleast_1d(np.asarray(which))
        if rows.dtype == bool and rows.shape == (self.count,):
            return np.flatnonzero(rows)
        if rows.size == 0:
            return np.zeros(0, dtype=int)
        if rows.ndim != 1 or rows.dtype.kind not in "iu":
            raise InputError(
                f"images is {rows.dtype} {rows.shape}; allowed: whole numbers, booleans of all, or a slice"
            )
        if rows.min() < -self.count or rows.max() >= self.count:
            worst = rows.min() if rows.min() < -self.count else rows.max()
            raise InputError(f"image is {worst}; allowed: 0 to {self.count - 1}")
        return rows.astype(int) % self.count

    def _label(self, name: str) -> np.ndarray:
        self._check(f"{name}/c/0")
        values = np.array(self._array(name)[...])
        self._compare("count", values.shape, (self.count,))
        values.setflags(write=False)
        return values

    def _check(self, name: str) -> None:
        """Compare a file with its checksum, once."""
        if name in self._good:
            return
        file = self._store.data / name
        try:
            found = hashlib.sha256(file.read_bytes()).hexdigest()
        except OSError as error:
            raise InputError(f"{file}: cannot be read ({error.strerror}); allowed: the file that was written") from None
        if found != self._checksums.get(name):
            raise InputError(f"{file}: is corrupt, its SHA-256 is {found[:12]}…; allowed: "
                             f"{self._checksums.get(name, 'none')[:12]}…, of the file that was written")  # fmt: skip
        self._good.add(name)

    @functools.cached_property
    def _group(self) -> dict[str, Any]:
        import zarr

        return dict(zarr.open_group(str(self._store.data), mode="r").arrays())

    @functools.cached_property
    def _images(self) -> Any:
        array = self._array("images")
        self._compare("count and shape", array.shape, (self.count, *self.shape))
        self._compare("chunk", array.chunks[0], self.manifest["chunk"])
        return array

    def _compare(self, what: str, there: Any, said: Any) -> None:
        """Refuse a manifest that says something else than an array."""
        if there != said:
            raise InputError(f"{self.folder / 'manifest.json'}: {what} = {said}; allowed: {there}, as the arrays are")

    def _array(self, name: str) -> Any:
        for file in ("zarr.json", f"{name}/zarr.json"):
            self._check(file)
        return self._group[name]


def open_dataset(path: str | Path) -> Dataset:
    """A data set that is finished.

    Raises:
        InputError: It is none, not finished, of another version, or labels are corrupt.
    """
    store = Store(Path(path))
    manifest, checksums = store.manifest(), store.checksums()
    if checksums is None:
        done = len(store.finished())
        raise InputError(f"{path}: is not finished, {done} of {manifest['poses']} poses are there; allowed: a whole "
                         "data set, the line that began it goes on")  # fmt: skip
    return Dataset(store, manifest, checksums)
