"""A training on disk: what was asked, where it stands, the best network so far; each file whole or not there.

out/vision/r18/
    run.json          what was asked, of which data set: written first, never changed
    checkpoint.pt     after an epoch: weights, optimiser, random numbers, curves
    network.pt        the best network: all that estimating needs
    curves.csv        learning curves, a line an epoch; also .json and .png
    metrics.json      what it reached on the test part; written last
"""

from __future__ import annotations

import hashlib
import json
import time
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import check_place, written
from otwarp.vision.networks.library import torch_library
from otwarp.vision.networks.weights import read_file

VERSION = 1
"""Of the layout of the folder."""

RUN, CHECKPOINT, NETWORK, METRICS = "run.json", "checkpoint.pt", "network.pt", "metrics.json"


class Seldom:
    """Does something now and then, so that it takes a tenth of the time at most.

    Args:
        first: Not before this [s].
    """

    SHARE = 0.1

    def __init__(self, first: float = 0.0):
        self.due = time.monotonic() + first

    @contextmanager
    def if_due(self) -> Iterator[bool]:
        """Whether it is time; after what is done within comes a pause that makes it that share."""
        begun = time.monotonic()
        yield begun >= self.due
        if begun >= self.due:
            now = time.monotonic()
            self.due = now + (1.0 / self.SHARE - 1.0) * (now - begun)


def check_folder(folder: Path, asked: Mapping[str, Any]) -> bool:
    """Whether a folder holds this training; nothing is written.

    Args:
        folder: Where.
        asked: What `run.json` is to say.

    Raises:
        InputError: The folder holds another training or other files, or cannot be written.
    """
    check_place(folder, "--out", folder=True)
    here = _said(asked)
    if (folder / RUN).exists():
        there = read_json(folder / RUN)
        found = _difference(there, here)
        if found:
            name, was, now = found
            raise InputError(f"{folder}: holds a training with another {name}: {was} there, {now} now; "
                             "allowed: the same training, or a new folder")  # fmt: skip
        return True
    if folder.exists() and any(not p.name.startswith(".") for p in folder.iterdir()):
        raise InputError(f"--out is {folder}, which holds other files; allowed: a new or empty folder, or a training's")
    return False


def begin(folder: Path, asked: Mapping[str, Any]) -> None:
    """Make the folder of a training, unless it is there.

    Args:
        folder: Where.
        asked: What `run.json` is to say.

    Raises:
        InputError: As of `check_folder`.
    """
    if not check_folder(folder, asked):
        folder.mkdir(parents=True, exist_ok=True)
        write_json(folder / RUN, _said(asked))


def digest(asked: Mapping[str, Any]) -> str:
    """Of a training: of all that its `run.json` says, by which its network is known.

    Args:
        asked: What that says, or is to say.
    """
    return hashlib.sha256(json.dumps(_said(asked), sort_keys=True).encode()).hexdigest()


def _said(asked: Mapping[str, Any]) -> dict[str, Any]:
    """As it is read back."""
    return json.loads(json.dumps({"version": VERSION, **asked}))


def _difference(there: Any, here: Any, name: str = "") -> tuple[str, Any, Any] | None:
    """The first thing in which two values of JSON differ, by its name."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in {**there, **here}:
            found = _difference(there.get(key), here.get(key), key)
            if found:
                return found
        return None
    return None if there == here else (name, there, here)


def read_json(file: Path) -> dict[str, Any]:
    """An object of JSON.

    Raises:
        InputError: The file is not there, or no such object.
    """
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: cannot be read ({error}); allowed: a file that otwarp vision train wrote") from None
    if not isinstance(found, dict):
        raise InputError(f"{file}: holds no object; allowed: a file that otwarp vision train wrote")
    return found


def write_json(file: Path, value: Any) -> None:
    """Write a value as JSON, the whole file or none."""
    with written(file, str(file)) as part:
        part.write_text(json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


def save(file: Path, value: Mapping[str, Any]) -> None:
    """Write tensors and plain values, the whole file or none.

    Raises:
        InputError: The file cannot be written.
        OSError: The disk is full.
    """
    with written(file, str(file)) as part, part.open("wb") as opened:
        try:
            torch_library().save(dict(value), opened)
        except RuntimeError as error:
            # torch's writer fails once more while it closes the archive, which hides what the disk said
            if isinstance(error.__context__, OSError):
                raise error.__context__ from None
            raise


def load(file: Path, allowed: str) -> dict[str, Any]:
    """Read what `save` wrote.

    Args:
        file: Where.
        allowed: What it may be, for an error.

    Raises:
        InputError: It is not there, cannot be read, is damaged, or is of another version.
    """
    if not file.is_file():
        raise InputError(f"{file}: is not there; allowed: {allowed}")
    found = read_file(file)
    _check_whole(file, allowed)
    if found.get("version") != VERSION:
        raise InputError(f"{file}: version is {found.get('version')!r}; allowed: {VERSION}, as this otwarp writes it")
    return found


def _check_whole(file: Path, allowed: str) -> None:
    """Compare the checksums in an archive, which torch does not when it reads one.

    Raises:
        InputError: It is damaged.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            bad = archive.testzip()
    except Exception as error:  # whatever a reader of archives raises where a header is damaged
        raise InputError(f"{file}: is damaged ({error}); allowed: {allowed}") from None
    if bad is not None:
        raise InputError(f"{file}: is damaged, the checksum of {bad} differs; allowed: {allowed}")


def random_state() -> dict[str, Any]:
    """Of every generator that a training may draw from."""
    torch = torch_library()
    gpus = torch.cuda.get_rng_state_all() if torch.cuda.is_available() else []
    return {"torch": torch.get_rng_state(), "cuda": gpus}


def set_random_state(state: Mapping[str, Any]) -> None:
    """Go on drawing where `random_state` was taken."""
    torch = torch_library()
    torch.set_rng_state(state["torch"])
    if state["cuda"] and torch.cuda.is_available():
        torch.cuda.set_rng_state_all(state["cuda"][: torch.cuda.device_count()])


def seeds(seed: int, epoch: int) -> tuple[int, int]:
    """Keys of an epoch's order and of its augmentation."""
    order, change = np.random.SeedSequence([seed, epoch]).generate_state(2, np.uint64) >> np.uint64(1)
    return int(order), int(change)
