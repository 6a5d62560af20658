"""What an item of the report is made of: figures of the paper, ours beside them, and what they mean."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.scene import Scene

GRADES = {
    "S": "stated in the paper or read in its public release",
    "I": "measured off a published picture",
    "D": "derived by us from what is published",
    "U": "unknown: not published",
}
"""How well a figure of the paper is known."""


class Unavailable(Exception):
    """An item that cannot be computed here; the message is one line that says what it lacks."""


@dataclass(frozen=True, kw_only=True)
class Value:
    """A number with what is known of its uncertainty, or words in its place.

    Attributes:
        number: None where there is none.
        spread: Standard deviation of what it is the mean of, in its unit; None where it is no mean.
        error: Its standard error, in its unit; None where none is known.
        interval: Its 95 % interval, in its unit.
        text: How it is printed, where that is not by `said`'s own rule; words where there is no number.
    """

    number: float | None = None
    spread: float | None = None
    error: float | None = None
    interval: tuple[float, float] | None = None
    text: str = ""

    def said(self) -> str:
        """As it is printed: three significant digits, ± the spread, the standard error or interval in brackets."""
        if self.number is None or self.text:
            return self.text or "–"
        out = shown(self.number)
        if self.spread is not None:
            out += f" ± {shown(self.spread)}"
        if self.error is not None:
            out += f" (SE {shown(self.error, 2)})"
        if self.interval is not None:
            out += f" [{shown(self.interval[0])}, {shown(self.interval[1])}]"
        return out


NOT_PUBLISHED = Value(text="not published")


def shown(number: float, digits: int = 3) -> str:
    """A number with so many significant digits, trailing zeros dropped, powers of ten as people write them."""
    text = f"{number:.{digits}g}"
    mantissa, _, power = text.partition("e")
    if not power:
        return text.replace("-", "−")
    raised = str(int(power)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa.replace('-', '−')}·10{raised}"


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A figure of the paper with ours beside it.

    Attributes:
        what: Of what.
        unit: "" for a pure number.
        paper, ours: The two.
        grade: Of the paper's, a key of `GRADES`; "" where it has none.
        remark: Why they differ, or what keeps them from being compared, in a few words.
        key: Whether it stands in the summary.
    """

    what: str
    unit: str = ""
    paper: Value = NOT_PUBLISHED
    grade: str = "U"
    ours: Value = Value()
    remark: str = ""
    key: bool = False


@dataclass(frozen=True, kw_only=True)
class Table:
    """More numbers, for people: the first column text, the others as they are to be printed."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A picture in the item's folder.

    Attributes:
        file: Its name, a PNG.
        caption: What it shows, one or two sentences.
    """

    file: str
    caption: str


@dataclass(frozen=True, kw_only=True)
class Result:
    """What an item found.

    Attributes:
        comparisons: Theirs and ours.
        definition: How the figures are defined, and what was computed.
        difference: Why theirs and ours differ.
        incomparable: What cannot be compared, and why.
        computed: How it was computed: what → how many, how long, with which seed.
        tables, figures: More to look at.
        files: Names of the CSV files beside them, with what they hold.
        numbers: More for programs; strict JSON.
    """

    comparisons: tuple[Comparison, ...]
    definition: str
    difference: str
    incomparable: tuple[str, ...] = ()
    computed: Mapping[str, str] = field(default_factory=dict)
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, Any] = field(default_factory=dict)

    def said(self) -> dict[str, Any]:
        """For a file."""
        return dataclasses.asdict(self)

    @classmethod
    def read(cls, said: Mapping[str, Any]) -> Result:
        """From a file.

        Raises:
            TypeError, KeyError: It does not hold a result.
        """
        rows = tuple(
            Comparison(**{**row, "paper": _value(row["paper"]), "ours": _value(row["ours"])})
            for row in said["comparisons"]
        )
        tables = tuple(
            Table(**{**t, "head": tuple(t["head"]), "rows": tuple(map(tuple, t["rows"]))}) for t in said["tables"]
        )
        figures = tuple(Figure(**f) for f in said["figures"])
        lists = {"comparisons": rows, "tables": tables, "figures": figures}
        return cls(**{**said, **lists, "incomparable": tuple(said["incomparable"])})


def _value(said: Mapping[str, Any]) -> Value:
    interval = said["interval"]
    return Value(**{**said, "interval": None if interval is None else (interval[0], interval[1])})


@dataclass(frozen=True, kw_only=True)
class Request:
    """What an item is asked for.

    Attributes:
        quick: Whether minutes on two cores have to do.
        device: cpu, cuda:0, …; None for the best there is.
        scenes: Folder of the shipped scenes.
        seed: Of all random numbers.
        folder: Where the item's figures and CSV files go.
        work: Where it keeps what it would go on from after an interruption; it goes when the item is done.
        say: Called with what is being done; it raises where the run is to end.
    """

    quick: bool
    device: str | None
    scenes: Path
    seed: int
    folder: Path
    work: Path
    say: Callable[[str], None]

    def choose(self, quick: int, full: int) -> int:
        """The one or the other."""
        return quick if self.quick else full

    def scene(self, name: str) -> Scene:
        """A shipped scene.

        Raises:
            InputError: The folder lacks it, or it does not load.
        """
        return Scene.load(scene_file(self.scenes, name))


def scene_file(folder: Path, name: str) -> Path:
    """Path of a shipped scene.

    Raises:
        InputError: The folder lacks it.
    """
    file = folder / f"{name}.usda"
    if not file.is_file():
        raise InputError(f"--scenes is {folder}, which has no {file.name}; allowed: the folder of the shipped scenes")
    return file


@dataclass(frozen=True, kw_only=True)
class Item:
    """An entry of the report.

    Attributes:
        name: By which `--only` knows it.
        title: Its heading.
        about: What of the paper it regenerates, in a line.
        run: Computes it.
        figures, tables: How many its result has, in full and in quick; the table of theirs and ours is the first.
        scenes: Of the shipped ones, that it needs.
    """

    name: str
    title: str
    about: str
    run: Callable[[Request], Result]
    figures: int
    tables: int
    scenes: tuple[str, ...] = ()
