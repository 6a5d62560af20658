"""Types of options: numbers in a stated range and files that can be written, refused before anything slow starts."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from otwarp import shipped
from otwarp.errors import InputError
from otwarp.files import check_place

FILE = click.Path(path_type=Path)
"""A file or folder, there or not."""


class ShippedPath(click.ParamType):
    """A file of the user's, or the name of a shipped one where there is none: `cell_delivery`.

    Args:
        kind: A row of `otwarp.shipped.ENDINGS`.
        folders: Whether a folder is allowed, too.
    """

    name = "path"

    def __init__(self, kind: str, *, folders: bool = False) -> None:
        self.kind, self.folders = kind, folders

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Find the file; a path with folders that means a shipped one is said on standard error."""
        path = Path(value)
        if self.folders and path.is_dir():
            return path
        found = shipped.find(self.kind, path)
        if found != path and path.parent != Path():
            click.echo(f"otwarp: {path} is not here: the shipped one is taken", err=True)
        return found

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Files are completed by the shell, names here."""
        known = [CompletionItem(name) for name in shipped.names(self.kind) if name.startswith(incomplete)]
        return [*known, CompletionItem(incomplete, type="file")]


USD = (".usda", ".usdc", ".usd")
"""What names of USD files that are written end with."""

MOVIE = (".gif", ".mp4", ".webm")
"""What names of movies that are written end with."""

SCENE = ShippedPath("scenes")
STUDY = ShippedPath("studies")
DATASET = ShippedPath("vision")
SCENE_OR_RUN = ShippedPath("scenes", folders=True)


def name_of(parameter: click.Parameter | None) -> str:
    """How a user knows an option or argument: `--rate`, `SCENE`."""
    if parameter is None:
        return "value"
    return parameter.opts[-1] if isinstance(parameter, click.Option) else parameter.human_readable_name.upper()


class Number(click.ParamType):
    """A finite number in a range.

    Args:
        low, high: Its ends.
        above: Whether `low` itself is not allowed.
        whole: Whether the number must be whole.
        unit: For messages.
    """

    name = "number"

    def __init__(
        self,
        low: float = 0.0,
        high: float = math.inf,
        *,
        above: bool = False,
        whole: bool = False,
        unit: str = "",
    ) -> None:
        self.low, self.high, self.above, self.whole, self.unit = low, high, above, whole, unit
        self.name = "integer" if whole else "float"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a number.

        Raises:
            InputError: None, or out of range.
        """
        try:
            number = int(value) if self.whole else float(value)
            good = self.low <= number <= self.high and not (self.above and number == self.low)
            if good and math.isfinite(number):
                return number
        except (ValueError, OverflowError):
            pass
        raise InputError(f"{name_of(param)} is {value}; allowed: {self.range()}")

    def range(self) -> str:
        """The allowed range in words."""
        low, high = (f"{end:.0f}" if self.whole else f"{end:g}" for end in (self.low, self.high))
        if math.isfinite(self.high):
            ends = f"above {low} and up to {high}" if self.above else f"{low} to {high}"
        else:
            ends = f"above {low}" if self.above else f"{low} or more"
        unit = f" {self.unit}" if self.unit else ""
        kind = "a whole number, " if self.whole else "finite, " if math.isinf(self.high) else ""
        return kind + ends + unit


class OutputPath(click.ParamType):
    """A file, or a folder with all that is in it, that a command will write.

    Args:
        folder: Whether it is a folder, which is made with those above it.
        endings: What its name may end with, as `.usda`; any without.
        check: Whether it is refused here; else the command does that, which does not always write.
    """

    name = "path"

    def __init__(self, *, folder: bool = False, endings: tuple[str, ...] = (), check: bool = True) -> None:
        self.folder, self.endings, self.check = folder, endings, check

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Read a path.

        Raises:
            InputError: Nothing could be written there, or its name says another format.
        """
        path = Path(value)
        if self.endings and path.suffix not in self.endings:
            said = f"{name_of(param)} is {path}: suffix = {path.suffix or '(none)'}"
            raise InputError(f"{said}; allowed: {', '.join(self.endings)}")
        if self.check:
            check_place(path, name_of(param), folder=self.folder)
        return path

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """What is there is completed by the shell."""
        return [CompletionItem(incomplete, type="dir" if self.folder else "file")]


class Values(click.ParamType):
    """Numbers in a range, ascending: `0:500:50` for those from 0 to 500 in steps of 50, `0,20,100`, or one.

    Args:
        each: What each of them may be.
    """

    name = "numbers"

    MOST = 1000
    """Numbers at most."""

    def __init__(self, each: Number) -> None:
        self.each = each

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Read them.

        Raises:
            InputError: None, too many, out of range, or not ascending.
        """
        if isinstance(value, tuple):
            return value
        text = str(value)
        allowed = f"START:END:STEP or numbers with commas between, ascending, at most {self.MOST}"
        parts = text.split(":" if ":" in text else ",")
        numbers = [float(self.each.convert(part, param, ctx)) for part in parts]
        if ":" in text:
            if len(numbers) != 3 or numbers[2] <= 0.0 or (numbers[1] - numbers[0]) / numbers[2] >= self.MOST:
                raise InputError(f"{name_of(param)} is {text}; allowed: {allowed}")
            first, last, step = numbers
            numbers = [round(first + n * step, 12) for n in range(math.floor((last - first) / step + 1e-9) + 1)]
        ascending = all(a < b for a, b in itertools.pairwise(numbers))
        if not 0 < len(numbers) <= self.MOST or not ascending:
            raise InputError(f"{name_of(param)} is {text}; allowed: {allowed}")
        return tuple(numbers)


UNIT = Number(0.0, 1e6, above=True)
"""What may be called 1 on a topic [µm], and the gain of a device there."""
POSITIVE = Number(0.0, above=True)


class Auto(Number):
    """A number in a range, or the word `auto`."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a number or `auto`.

        Raises:
            InputError: Neither, or out of range.
        """
        return value if value == "auto" else super().convert(value, param, ctx)

    def range(self) -> str:
        """The allowed range in words."""
        return f"auto, or {super().range()}"


COUNT = Number(1, whole=True)
SECONDS = Number(0.0, above=True, unit="s")
SEED = Number(0, 2**32 - 1, whole=True)
FRACTION = Number(0.0, 1.0, above=True)
