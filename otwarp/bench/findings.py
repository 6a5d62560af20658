"""What benchmarks found, as files: written by `--out`, and for some read again by `--with`."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, get_args, get_origin, get_type_hints

from otwarp.errors import InputError
from otwarp.files import written

if TYPE_CHECKING:
    from otwarp.optics import Beam, Particle


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What one benchmark found on one device.

    Attributes:
        FORMAT, VERSION: The head of its file.
        kind: `cpu` (processor time of one thread, unless a row says otherwise) or `cuda` (wall time).
        hardware: Name of the processor or accelerator that did the work.
        machine: Its description, see `otwarp.bench.machine.Machine`.
    """

    FORMAT: ClassVar[str]
    VERSION: ClassVar[int] = 1

    kind: str
    hardware: str
    machine: dict[str, Any]

    def json(self) -> dict[str, Any]:
        """The findings as plain data for JSON."""
        return {"format": self.FORMAT, "version": self.VERSION, **dataclasses.asdict(self)}

    def save(self, file: Path) -> None:
        """Write as JSON, to a temporary file that then takes the name.

        Raises:
            InputError: The file cannot be written.
        """
        with written(file, f"--out {file}") as part:
            part.write_text(json.dumps(self.json(), indent=1, ensure_ascii=False, allow_nan=False) + "\n", "utf-8")


@dataclass(frozen=True, kw_only=True)
class BeadFindings(Findings):
    """What was found for one bead in one trap on one device: runs can be set beside each other.

    Attributes:
        beam, sphere: The bead and its trap, as plain numbers.
    """

    beam: dict[str, Any]
    sphere: dict[str, Any]

    def bead(self) -> str:
        """The bead and its trap in words."""
        b, s = self.beam, self.sphere
        return (
            f"r = {s['radius']:g} µm, n = {s['index']:g} in {b['medium_index']:g}, {b['kind']} beam, NA "
            f"{b['numerical_aperture']:g}, {b['polarization']} polarization"
        )

    def check(self) -> None:
        """Raise `KeyError`, `TypeError` or `ValueError` for what no benchmark finds."""
        self.bead()

    @classmethod
    def from_json(cls, data: Any) -> Self:
        """The inverse of `json`.

        Raises:
            KeyError, TypeError, ValueError: Not what `json` gave.
        """
        fields = dict(data)
        if (fields.pop("format"), fields.pop("version")) != (cls.FORMAT, cls.VERSION):
            raise ValueError("another format or version")
        found = rebuilt(cls, fields)
        found.check()
        return found

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
            raise InputError(f"--with {file} is not what --out writes; allowed: a file of {cls.FORMAT}") from error


def bead_fields(beam: Beam, sphere: Particle) -> dict[str, Any]:
    """`beam` and `sphere` of `BeadFindings`; the sphere's index is real."""
    plain = {"radius": sphere.radius, "index": complex(sphere.index).real}
    return {"beam": dataclasses.asdict(beam), "sphere": plain}


def rebuilt(kind: Any, data: Any) -> Any:
    """A value of an annotated type, out of what `dataclasses.asdict` and JSON made of it.

    Raises:
        KeyError, TypeError, ValueError: It is something else.
    """
    parts = get_args(kind)
    if dataclasses.is_dataclass(kind):
        hints = get_type_hints(kind)
        return kind(**{name: rebuilt(hints[name], value) for name, value in dict(data).items()})  # type: ignore[operator]
    if get_origin(kind) is dict:
        return {name: rebuilt(parts[1], value) for name, value in data.items()}
    if get_origin(kind) is tuple:
        endless = parts[-1] is ...
        pairs = zip(repeat(parts[0]) if endless else parts, data, strict=not endless)
        return tuple(rebuilt(part, value) for part, value in pairs)
    if type(None) in parts:
        return None if data is None else rebuilt(parts[0], data)
    return float(data) if kind is float else data
