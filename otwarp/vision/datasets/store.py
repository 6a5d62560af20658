"""A data set on disk: zarr arrays of images and labels, what they mean, and checksums that say that it is whole.

    out/vision/paper/
        manifest.json      what was asked, versions: written first, never changed
        data.zarr          zarr v3: images (n, height, width) uint8, and an array (n) for every label
        done/000012        while it is made: pose 12 is whole, with the checksums of its chunks
        README.md          data card
        samples.png        some images, to look at
        checksums.json     sha256 of every file of data.zarr, written last

A pose is rendered by one task and fills whole chunks; it depends on nothing but the manifest, so that it may be
rendered twice, by anyone, in any order.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.vision.datasets.domain import PARAMETERS
from otwarp.vision.datasets.labels import Labels
from otwarp.vision.datasets.manifest import ATTRIBUTES, VERSION, check_manifest
from otwarp.vision.sensor import NOISE

MANIFEST, DATA = "manifest.json", "data.zarr"
"""What every data set holds: the first of its files, and the folder of its arrays."""


@dataclass(frozen=True)
class Store:
    """The folder of a data set."""

    folder: Path

    @property
    def data(self) -> Path:
        """Folder of the zarr group that holds images and labels."""
        return self.folder / DATA

    def manifest(self) -> dict[str, Any]:
        """What `manifest.json` says.

        Raises:
            InputError: It is not there, not readable, of another version, or says what cannot be.
        """
        file = self.folder / MANIFEST
        try:
            said = json.loads(file.read_text(encoding="utf-8"))
        except (FileNotFoundError, NotADirectoryError):
            raise InputError(
                f"{self.folder}: holds no data set; allowed: a folder that otwarp vision dataset has made"
            ) from None
        except (OSError, ValueError) as error:
            raise InputError(f"{file}: cannot be read ({error}); allowed: what otwarp vision dataset wrote") from None
        check_manifest(said, file)
        return said

    def checksums(self) -> dict[str, str] | None:
        """Of all files of the zarr group, or None while it is made.

        Raises:
            InputError: They cannot be read.
        """
        file = self.folder / "checksums.json"
        return _sums_in(file) if file.exists() else None

    def finished(self) -> list[int]:
        """Poses that are whole."""
        folder = self.folder / "done"
        return sorted(int(f.name) for f in folder.iterdir() if f.name.isdecimal()) if folder.is_dir() else []

    def finished_sums(self) -> dict[str, str]:
        """Checksums of the chunks of all poses that are whole, as their markers say.

        Raises:
            InputError: A marker cannot be read.
        """
        sums: dict[str, str] = {}
        for pose in self.finished():
            sums |= _sums_in(self.folder / "done" / f"{pose:06d}")
        return sums

    def check_there(self, names: Iterable[str]) -> None:
        """Look whether some files of the zarr group are there.

        Args:
            names: Relative to the group.

        Raises:
            InputError: One is not.
        """
        for name in names:
            if not (self.data / name).is_file():
                raise InputError(f"{self.data / name}: is not there; allowed: the file that was written")

    def begin(self, labels: Iterable[str]) -> None:
        """Make what is needed to go on, and look whether everything is there that was made.

        Args:
            labels: Names of all arrays but the images.

        Raises:
            InputError: A file is lost or damaged.
        """
        import zarr

        done = self.folder / "done"
        if not done.is_dir() and (done.exists() or done.is_symlink()):
            raise InputError(f"{done}: is no folder; allowed: the one that was made, or none")
        done.mkdir(exist_ok=True)  # git and archives leave empty folders out
        self.check_there(["zarr.json", "images/zarr.json", *(f"{name}/c/0" for name in labels)])
        for name in ("images", *labels):
            self.check_there([f"{name}/zarr.json"])
            try:
                zarr.open_array(str(self.data / name), mode="r")
            except Exception as error:  # whatever zarr raises of a text that is no description of an array
                file = self.data / name / "zarr.json"
                raise InputError(f"{file}: cannot be read ({error}); allowed: the file that was written") from None
        self.check_there(self.finished_sums())

    def chunk_files(self, rows: slice, chunk: int) -> list[str]:
        """Files of the chunks that hold some rows, relative to the zarr group."""
        return [f"images/c/{n}/0/0" for n in range(rows.start // chunk, -(-rows.stop // chunk))]

    def keep(self, pose: int, rows: slice, chunk: int, images: np.ndarray) -> None:
        """Write the images of a pose, its marker last.

        Raises:
            OSError: The disk is full, or the folder has gone; it names a file.
        """
        import zarr

        try:
            zarr.open_array(str(self.data / "images"), mode="r+")[rows] = images
            sums = {name: sha256(self.data / name) for name in self.chunk_files(rows, chunk)}
            with written(self.folder / "done" / f"{pose:06d}") as part:
                part.write_text(json.dumps(sums), encoding="utf-8")
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(error.filename or self.data)) from error

    def finish(self) -> None:
        """Write the checksums of everything, those of images as they were when they were written."""
        for part in self.data.rglob("*.partial"):  # zarr's, of a process that was killed while it wrote a chunk
            part.unlink(missing_ok=True)
        sums = self.finished_sums()
        for file in sorted(p for p in self.data.rglob("*") if p.is_file()):
            name = file.relative_to(self.data).as_posix()
            if name not in sums:
                sums[name] = sha256(file)
        write_json(self.folder / "checksums.json", dict(sorted(sums.items())))


def _sums_in(file: Path) -> dict[str, str]:
    """Names of files and their checksums.

    Raises:
        InputError: There is something else in the file.
    """
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: cannot be read ({error}); allowed: what otwarp vision dataset wrote") from None
    if not isinstance(found, dict) or not found or not all(isinstance(v, str) for v in found.values()):
        raise InputError(f"{file}: holds no checksums; allowed: what otwarp vision dataset wrote")
    return found


def sha256(file: Path) -> str:
    """Of the bytes of a file."""
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


def write_json(file: Path, what: Mapping[str, Any]) -> None:
    """Write a file that appears whole."""
    with written(file) as part:
        part.write_text(json.dumps(what, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def manifest_of(labels: Labels, versions: Mapping[str, str]) -> dict[str, Any]:
    """What a manifest says of a data set."""
    spec = labels.spec
    names = [name for name in labels.arrays if name.startswith("split_")]
    return {
        "version": VERSION,
        "format": "otwarp vision dataset",
        "versions": dict(versions),
        "noise": NOISE,
        "count": labels.count,
        "poses": labels.poses,
        "shape": [spec.height, spec.width],
        "chunk": labels.chunk,
        "labels": sorted(labels.arrays),
        "splits_made": [name.removeprefix("split_") for name in names],
        **spec.described(),
        "file": spec.text,
    }


def create_arrays(place: Path, labels: Labels) -> None:
    """The zarr group: labels with their values, and images that are not there yet."""
    import zarr

    spec, n = labels.spec, labels.count
    group = zarr.open_group(str(place), mode="w", zarr_format=3)
    group.create_array(
        "images",
        shape=(n, spec.height, spec.width),
        chunks=(labels.chunk, spec.height, spec.width),
        dtype="uint8",
        fill_value=0,
        dimension_names=("image", "y", "x"),
        attributes={"units": "grey level", "long_name": "image; row 0 is the lowest"},
        config={"write_empty_chunks": True},
    )
    for name, values in labels.arrays.items():
        units, about = label_attributes(name)
        array = group.create_array(
            name, shape=(n,), chunks=(n,), dtype=values.dtype, fill_value=0, dimension_names=("image",),
            attributes={"units": units, "long_name": about}, config={"write_empty_chunks": True},
        )  # fmt: skip
        array[...] = values


def label_attributes(name: str) -> tuple[str, str]:
    """Units and meaning of a label."""
    if name in PARAMETERS:
        return PARAMETERS[name].units, PARAMETERS[name].about
    return ATTRIBUTES.get(name, ("1", "0 train, 1 validation, 2 test, -1 unused"))
