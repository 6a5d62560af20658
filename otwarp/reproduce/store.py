"""The folder of a report: what was asked of it, and a folder for each item, which is there when it is whole.

out/paper/
    reproduce.json          format, version, quick or full, seed
    items/NAME/             item.json, figures (PNG), series (CSV)
    work/NAME/              what an item that is not done goes on from, and its parts so far
    report.html             all of it in one file
    numbers.json, numbers.csv
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from otwarp import __version__
from otwarp.errors import InputError
from otwarp.files import check_place, made_apart, written
from otwarp.reproduce.code import Code
from otwarp.reproduce.item import Item, Result
from otwarp.reproduce.parts import Part

FORMAT = 2
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
        parts: In which it was computed.
    """

    name: str
    title: str
    about: str
    result: Result
    folder: Path
    parts: tuple[Part, ...]

    @property
    def device(self) -> str:
        """On which it was computed; several where it went on on another."""
        return ", ".join(dict.fromkeys(part.device for part in self.parts))

    @property
    def seconds(self) -> float:
        """Wall time, of all parts together."""
        return sum(part.seconds for part in self.parts)

    @property
    def code(self) -> Code:
        """That which computed it."""
        return self.parts[-1].code


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

    def tidy(self, name: str) -> None:
        """Remove what an item that is done went on from."""
        shutil.rmtree(self.folder / "work" / name, ignore_errors=True)

    @contextmanager
    def making(self, item: Item, parts: Callable[[], Sequence[Part]]) -> Iterator[tuple[Path, list[Result]]]:
        """A folder for an item's files, which takes its name when a result was put into the list; else it goes.

        Args:
            item: Which.
            parts: Called at the end: those of `Done`.
        """
        (self.folder / "items").mkdir(exist_ok=True)
        found: list[Result] = []
        with made_apart(self.item_folder(item.name), ITEM) as apart:
            yield apart, found
            said = {"format": FORMAT, "name": item.name, "title": item.title, "about": item.about,
                    "parts": [asdict(part) for part in parts()], "result": found[0].said()}  # fmt: skip
            write_json(apart / ITEM, said)

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
            parts, result = tuple(map(Part.read, said["parts"])), Result.read(said["result"])
            lost = [one.file for one in result.figures if not (folder / one.file).is_file()]
            if lost or not parts:
                raise ValueError(f"{lost[0]} is lost" if lost else "no part")
            return Done(**{**said, "parts": parts, "result": result, "folder": folder})
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
        if found["otwarp"] != __version__:
            raise _of_another_version(folder, found)
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
    """What was asked of a report, also of one that another version wrote in the same format.

    Raises:
        InputError: There is none, or one of another format.
    """
    head = folder / HEAD
    try:
        found = json.loads(head.read_text(encoding="utf-8"))
        kind = found["format"]
        good = isinstance(found["quick"], bool) and isinstance(found["seed"], int) and isinstance(found["otwarp"], str)
    except OSError as error:
        raise InputError(f"--out is {folder}, which has no {HEAD} ({error.strerror}); allowed: the folder of a "
                         "report") from None  # fmt: skip
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{head}: contents cannot be read; allowed: what otwarp reproduce wrote") from None
    if kind != FORMAT or not good:
        raise _of_another_version(folder, found)
    return found


def _of_another_version(folder: Path, found: dict[str, Any]) -> InputError:
    return InputError(f"--out is {folder}, which otwarp {found['otwarp']} wrote (format {found['format']}); allowed: a "
                      f"folder of otwarp {__version__} (format {FORMAT}), or a new one")  # fmt: skip
