"""The folder of a report: what was asked of it, and a folder for each item, which is there when it is whole.

out/paper/
    reproduce.json          format, version, quick or full, seed
    items/NAME/             item.json, figures (PNG), series (CSV)
    work/NAME/              what an item that is not done goes on from
    report.html             all of it in one file
    numbers.json, numbers.csv
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from otwarp import __version__
from otwarp.errors import InputError
from otwarp.files import check_place, made_apart, written
from otwarp.reproduce.item import Item, Result

FORMAT = 1
"""Of all files; another one is not read."""

HEAD = "reproduce.json"
ITEM = "item.json"


@dataclass(frozen=True, kw_only=True)
class Done:
    """An item that is done.

    Attributes:
        name, title, about: As of `Item`.
        result: What it found.
        folder: Where its files are.
        device: On which it was computed.
        machine: Processor, system and versions, in a line.
        seconds: How long it took.
    """

    name: str
    title: str
    about: str
    result: Result
    folder: Path
    device: str
    machine: str
    seconds: float


@dataclass(frozen=True)
class Store:
    """A folder with its items.

    Attributes:
        folder: Where.
        quick: Whether items are computed in minutes.
        seed: Of all random numbers.
    """

    folder: Path
    quick: bool
    seed: int

    def item_folder(self, name: str) -> Path:
        """Where an item is when it is done."""
        return self.folder / "items" / name

    def work_folder(self, name: str) -> Path:
        """Where an item keeps what it goes on from; it is made."""
        folder = self.folder / "work" / name
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def has(self, name: str) -> bool:
        """Whether an item is done."""
        return (self.item_folder(name) / ITEM).is_file()

    @contextmanager
    def making(self, item: Item, facts: Callable[[], dict[str, Any]]) -> Iterator[tuple[Path, list[Result]]]:
        """A folder for an item's files, which takes its name when a result was put into the list; else it goes.

        Args:
            item: Which.
            facts: Called at the end: `device`, `machine`, `seconds` of `Done`.
        """
        (self.folder / "items").mkdir(exist_ok=True)
        found: list[Result] = []
        with made_apart(self.item_folder(item.name), ITEM) as apart:
            yield apart, found
            said = {"format": FORMAT, "name": item.name, "title": item.title, "about": item.about, **facts(),
                    "result": found[0].said()}  # fmt: skip
            write_json(apart / ITEM, said)
        shutil.rmtree(self.folder / "work" / item.name, ignore_errors=True)

    def read(self, name: str) -> Done:
        """An item that is done.

        Raises:
            InputError: Its file is damaged, or of another version.
        """
        folder = self.item_folder(name)
        file = folder / ITEM
        try:
            said = json.loads(file.read_text(encoding="utf-8"))
            if said.pop("format") != FORMAT:
                raise ValueError("another format")
            return Done(**{**said, "result": Result.read(said["result"]), "folder": folder})
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{file}: contents cannot be read ({' '.join(str(error).split())}); allowed: what this "
                             f"version wrote; without {folder} it is computed again") from None  # fmt: skip


def write_json(path: Path, said: Any) -> None:
    """Strict JSON, whole or not at all."""
    text = json.dumps(said, indent=1, ensure_ascii=False, allow_nan=False)
    with written(path) as part:
        part.write_text(text + "\n", encoding="utf-8")


def open_store(folder: Path, *, quick: bool, seed: int) -> Store:
    """The folder, begun now or before with the same choices.

    Raises:
        InputError: It cannot be written, holds something else, or a report of other choices or another version.
    """
    check_place(folder, "--out", folder=True)
    head, asked = folder / HEAD, {"quick": quick, "seed": seed}
    if head.exists():
        found = read_head(folder)
        for name, value in asked.items():
            if found[name] != value:
                kind = ("a quick" if found["quick"] else "a full") if name == "quick" else f"seed {found['seed']} of a"
                raise InputError(f"--out is {folder}, which holds {kind} report; allowed: a new folder, or the same "
                                 "choices again")  # fmt: skip
        return Store(folder, quick, seed)
    if folder.is_dir() and any(not p.name.startswith(".") for p in folder.iterdir()):
        raise InputError(f"--out is {folder}, which holds something else; allowed: a new folder, an empty one, or a "
                         "report to go on with")  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    write_json(head, {"format": FORMAT, "otwarp": __version__, **asked})
    return Store(folder, quick, seed)


def read_head(folder: Path) -> dict[str, Any]:
    """What was asked of a report.

    Raises:
        InputError: There is none, or one of another version.
    """
    head = folder / HEAD
    try:
        found = json.loads(head.read_text(encoding="utf-8"))
        version, kind = found["otwarp"], found["format"]
        good = isinstance(found["quick"], bool) and isinstance(found["seed"], int)
    except OSError as error:
        raise InputError(f"--out is {folder}, which has no {HEAD} ({error.strerror}); allowed: the folder of a "
                         "report") from None  # fmt: skip
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{head}: contents cannot be read; allowed: what otwarp reproduce wrote") from None
    if kind != FORMAT or version != __version__ or not good:
        raise InputError(f"--out is {folder}, which otwarp {version} wrote (format {kind}); allowed: a folder of "
                         f"otwarp {__version__} (format {FORMAT}), or a new one")  # fmt: skip
    return found
