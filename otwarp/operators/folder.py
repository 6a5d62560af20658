"""A study of SIMULATED operators on disk: what was asked, and a file for every chunk that is whole.

out/operators/
    study.json        what was asked, with digests, versions and seed: written first, never changed
    population.toml   who the operators are, byte for byte
    chunks/000012.npz trials of chunk 12
    done/000012       written when that file is whole
"""

from __future__ import annotations

import json
import warnings
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from otwarp.errors import InputError
from otwarp.files import check_place, claimed, made_apart, written
from otwarp.operators.population import Population
from otwarp.studies.differences import difference


class Computed(Protocol):
    """A study in chunks: `otwarp.operators.study.OperatorStudy`, `otwarp.operators.perception.sweep.Sweep`."""

    @property
    def population(self) -> Population:
        """Who the operators are."""
        ...

    @property
    def chunks(self) -> int:
        """How many there are."""
        ...

    def asked(self) -> dict[str, Any]:
        """All that the results follow from, as JSON."""
        ...

    def members(self, chunk: int) -> np.ndarray:
        """(n) numbers of the operators of a chunk's trials."""
        ...

    def run_chunk(self, chunk: int, *, device: str | None = None) -> dict[str, np.ndarray]:
        """Arrays (…, n) of the trials of a chunk, by name."""
        ...


@dataclass(frozen=True)
class Folder:
    """The folder of a study; made by `create` or found by `open_folder`."""

    path: Path

    def asked(self) -> dict[str, Any]:
        """What `study.json` says.

        Raises:
            InputError: It is not there, not readable, or of something else.
        """
        file = self.path / "study.json"
        try:
            said = json.loads(file.read_text(encoding="utf-8"))
            if said["version"] != 1 or said["simulated"] is not True:
                raise KeyError("simulated")
        except (OSError, ValueError, KeyError, TypeError) as error:
            why = getattr(error, "strerror", None) or "no study of simulated operators"
            raise InputError(f"{file}: {why}; allowed: a folder that otwarp operators run or sweep has made") from None
        return said

    def done(self, chunk: int) -> bool:
        """Whether a chunk is whole."""
        return (self.path / "done" / f"{chunk:06d}").exists()

    def write(self, chunk: int, arrays: dict[str, np.ndarray]) -> None:
        """Write a chunk, its marker last.

        Raises:
            OSError: The disk is full, or the folder has gone.
        """
        with written(self.path / "chunks" / f"{chunk:06d}.npz") as part, part.open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
        with written(self.path / "done" / f"{chunk:06d}") as part:
            part.write_text("", encoding="utf-8")

    def read(self) -> dict[str, np.ndarray]:
        """Trials of all chunks that are whole, (conditions, n) each, with `operator` (n), the numbers of theirs.

        Raises:
            InputError: None is, or one cannot be read.
        """
        names = sorted(p.name for p in (self.path / "done").glob("[0-9]*"))
        if not names:
            raise InputError(f"{self.path}: no chunk is computed yet; allowed: otwarp operators run, then show")
        parts: list[dict[str, np.ndarray]] = []
        for name in names:
            parts.append(arrays_of(self.path / "chunks" / f"{name}.npz"))
            if parts[-1].keys() != parts[0].keys():
                raise InputError(f"{self.path / 'chunks' / name}.npz: holds other arrays than {names[0]}.npz; allowed: "
                                 "the file that was written")  # fmt: skip
        return {key: np.concatenate([part[key] for part in parts], axis=-1) for key in parts[0]}


def arrays_of(file: Path) -> dict[str, np.ndarray]:
    """The arrays of a file that a study wrote.

    Raises:
        InputError: It is lost, cut short or damaged.
    """
    try:
        with file.open("rb") as opened, np.load(opened, allow_pickle=False) as found:
            return {key: found[key] for key in found.files}
    except (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        why = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise InputError(f"{file}: cannot be read ({why}); allowed: the file that was written") from None


def open_folder(path: Path) -> Folder:
    """A study that is there, at a path.

    Raises:
        InputError: It is none.
    """
    folder = Folder(path)
    folder.asked()
    return folder


def create(path: Path, study: Computed) -> Folder:
    """Make the folder of a study, or find the same study in it.

    Raises:
        InputError: The folder holds another study or other files, or cannot be written.
    """
    folder, asked = Folder(path), study.asked()
    if not (path / "study.json").exists():
        check_place(path, "--out", folder=True)
        if path.exists() and any(not p.name.startswith(".") for p in path.iterdir()):
            raise InputError(f"--out is {path}, which holds other files; allowed: a new or empty folder")
        with made_apart(path, "study.json") as apart:
            (apart / "done").mkdir()
            (apart / "chunks").mkdir()
            (apart / "population.toml").write_bytes(study.population.text)
            text = json.dumps(asked, indent=1, ensure_ascii=False) + "\n"
            (apart / "study.json").write_text(text, encoding="utf-8")
    check_same(folder, asked)
    return folder


def check_same(folder: Folder, asked: dict[str, Any]) -> None:
    """Refuse to go on with another study than the one that the folder holds.

    Raises:
        InputError: They differ; the message says in what.
    """
    there, here = (json.loads(json.dumps(said)) for said in (folder.asked(), asked))
    made, now = there.pop("versions", None), here.pop("versions", None)
    for said in (there, here):  # where the scene lies does not matter, what it says does
        said["scene"].pop("file", None)
    found = difference(there, here)
    if found is not None:
        where, a, b = found
        raise InputError(f"{folder.path}: holds a study with another {where}: {a} there, {b} now; "
                         "allowed: the same study, or a new folder")  # fmt: skip
    if made != now:
        warnings.warn(
            f"{folder.path}: was begun with other versions; trials may differ in their last bits", stacklevel=2
        )


def run_study(
    study: Computed,
    path: str | Path,
    *,
    device: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Folder:
    """Compute a study, or go on with it; a chunk is written when it is whole.

    Args:
        study: What is asked.
        path: Its folder.
        device: Where; None for the best available.
        progress: Called with chunks done and in all, after each.

    Raises:
        InputError: As `create`; or another process works in the folder.
        OSError: The disk is full.
    """
    path = Path(path)
    folder = create(path, study)
    with claimed(path, "runs this study; allowed: one at a time"):
        for chunk in range(study.chunks):
            if not folder.done(chunk):
                found = study.run_chunk(chunk, device=device)
                folder.write(chunk, {**found, "operator": study.members(chunk)})
            if progress is not None:
                progress(chunk + 1, study.chunks)
    return folder
