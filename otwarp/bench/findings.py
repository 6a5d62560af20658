"""What benchmarks found, as files: written by `--json`, and for some read again by `--with`."""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar, Self

from otwarp.bench.timing import Spread
from otwarp.errors import InputError


class Findings(ABC):
    """What one benchmark found.

    Attributes:
        FORMAT, VERSION: The head of its file.
    """

    FORMAT: ClassVar[str]
    VERSION: ClassVar[int] = 1

    @abstractmethod
    def json(self) -> dict[str, Any]:
        """Plain data."""

    def save(self, file: Path) -> None:
        """Write as JSON, to a temporary file that then takes the name.

        Raises:
            InputError: The file cannot be written.
        """
        part = file.with_name(f".{file.name}.part")
        try:
            part.write_text(json.dumps(self.json(), indent=1, ensure_ascii=False, allow_nan=False) + "\n", "utf-8")
            part.replace(file)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise InputError(f"--json {file} cannot be written: {error.strerror}") from error


class BeadFindings(Findings):
    """What was found for one bead in one trap on one device: runs can be set beside each other.

    Attributes:
        kind: `cpu` (processor time of one thread) or `cuda` (wall time).
        hardware: Name of the processor or accelerator that did the work.
        beam, sphere: The bead and its trap, as plain numbers.
    """

    kind: str
    hardware: str
    beam: dict[str, Any]
    sphere: dict[str, Any]

    def bead(self) -> str:
        """The bead and its trap in words."""
        b, s = self.beam, self.sphere
        return (
            f"r = {s['radius']:g} µm, n = {s['index']:g} in {b['medium_index']:g}, {b['kind']} beam, NA "
            f"{b['numerical_aperture']:g}, {b['polarization']} polarization"
        )

    @classmethod
    @abstractmethod
    def from_json(cls, data: Any) -> Self:
        """The inverse of `json`.

        Raises:
            KeyError, TypeError, ValueError: Not what `json` gave.
        """

    @classmethod
    def fields_of(cls, data: Any) -> dict[str, Any]:
        """A copy of what `json` gave, without the head.

        Raises:
            KeyError, TypeError, ValueError: Another head.
        """
        fields = dict(data)
        if (fields.pop("format"), fields.pop("version")) != (cls.FORMAT, cls.VERSION):
            raise ValueError("another format or version")
        return fields

    @classmethod
    def read(cls, file: Path) -> Self:
        """What `save` wrote.

        Raises:
            InputError: No such file, or something else in it.
        """
        try:
            return cls.from_json(json.loads(file.read_text("utf-8")))
        except OSError as error:
            raise InputError(f"--with {file} cannot be read: {error.strerror}") from error
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"--with {file} is not what --json writes; allowed: a file of {cls.FORMAT}") from error


def positive(value: Any) -> float:
    """A number that a file says is positive.

    Raises:
        ValueError: It is not.
    """
    if not (isinstance(value, float) and math.isfinite(value) and value > 0.0):
        raise ValueError("a number that is not positive")
    return value


def costs_of(row: dict[str, Any]) -> dict[str, Spread]:
    """`cost` and `ratio` of a row of a file.

    Raises:
        KeyError, TypeError, ValueError: They are not there, or not positive.
    """
    return {key: Spread(**{k: positive(v) for k, v in row[key].items()}) for key in ("cost", "ratio")}
