"""What a stress test finds in one cell: accurate, stable with a stated error, refused, stopped, or silently wrong."""

from __future__ import annotations

import enum
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError, PlausibilityWarning, SimulationError

ACCURACY = 0.01
"""Error up to which a cell is accurate: the default `ot:scene:accuracy`."""

COARSE = 0.1
"""Error up to which a cell is stable although otwarp predicts less; above it a run must warn, refuse or stop."""

SHARE = 0.1
"""By how much an error may miss its prediction, relative to it."""

LIKELY, CERTAIN = 3.0, 5.0
"""Standard errors that chance may add to an error for a cell to be accurate, and for it not to be wrong: one false
alarm in 10⁶ cells."""


class CellVerdict(enum.Enum):
    """How a cell ended; the value is its letter in tables."""

    ACCURATE = "A"
    STABLE = "S"
    REFUSED = "R"
    STOPPED = "X"
    WRONG = "W"


LEGEND = {
    CellVerdict.ACCURATE: f"accurate: within {100 * ACCURACY:g} % of the closed form",
    CellVerdict.STABLE: f"stable with the stated error: as predicted or within {100 * COARSE:g} %; or no closed form",
    CellVerdict.REFUSED: "refused with a clear error before the run",
    CellVerdict.STOPPED: "stopped with a clear error, last good state kept",
    CellVerdict.WRONG: "silently wrong: a defect",
}
"""What the letters mean."""


class Defect(Exception):
    """A cell found something that must never be; the message says what."""


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """What a run gave against its closed form.

    Attributes:
        error: Relative to the scale that the closed form sets.
        standard_error: Of `error` by chance; 0 for a run without noise.
        predicted: Error that otwarp itself predicts, as `otwarp info` shows it.
        told: Where otwarp tells a bound instead, that bound; nothing above it is stated then.
    """

    error: float
    standard_error: float = 0.0
    predicted: float = 0.0
    told: float | None = None

    @property
    def verdict(self) -> CellVerdict:
        """Accurate, stable or wrong."""
        chance = CERTAIN * self.standard_error
        if not math.isfinite(self.error):
            return CellVerdict.WRONG
        if abs(self.error) <= ACCURACY + LIKELY * self.standard_error:
            return CellVerdict.ACCURATE
        missed = abs(self.error - self.predicted)
        most = COARSE if self.told is None else self.told
        if abs(self.error) <= most + chance or missed <= max(ACCURACY, SHARE * abs(self.predicted)) + chance:
            return CellVerdict.STABLE
        return CellVerdict.WRONG


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One cell of a grid.

    Attributes:
        row, column: Its place, as in the grid's heads.
        verdict: How it ended.
        error, standard_error, predicted, told: As `Deviation`; None where nothing was measured.
        message: The error that was raised, or what is wrong.
        warned: Warnings of the run.
    """

    row: str
    column: str
    verdict: CellVerdict
    error: float | None = None
    standard_error: float | None = None
    predicted: float | None = None
    told: float | None = None
    message: str = ""
    warned: tuple[str, ...] = ()

    def json(self) -> dict[str, object]:
        """Plain data; numbers that are not finite are null."""
        numbers = {name: getattr(self, name) for name in ("error", "standard_error", "predicted", "told")}
        finite = {n: v if v is not None and math.isfinite(v) else None for n, v in numbers.items()}
        fields = {"row": self.row, "column": self.column, "verdict": self.verdict.name.lower(), **finite}
        return {**fields, "message": self.message, "warned": list(self.warned)}


def judge(row: str, column: str, measure: Callable[[], Deviation | None]) -> Cell:
    """Run one cell; None from `measure` is a run that kept all invariants, with no closed form to compare with.

    A large error of which the run warned is a stated one.
    """
    at: dict[str, Any] = {"row": row, "column": column}
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            found = measure()
        except InputError as error:
            return Cell(**at, verdict=_reported(CellVerdict.REFUSED, error), message=str(error), warned=_texts(heard))
        except SimulationError as error:
            return Cell(**at, verdict=_reported(CellVerdict.STOPPED, error), message=str(error), warned=_texts(heard))
        except Defect as error:
            return Cell(**at, verdict=CellVerdict.WRONG, message=str(error), warned=_texts(heard))
    if found is None:
        return Cell(**at, verdict=CellVerdict.STABLE, warned=_texts(heard))
    verdict, message = found.verdict, ""
    if verdict is CellVerdict.WRONG:
        if math.isfinite(found.error) and _texts(heard):
            verdict = CellVerdict.STABLE
        else:
            message = f"error {found.error:.3g} ± {found.standard_error:.2g}, otwarp predicts {found.predicted:.3g}"
            message += f" and tells up to {found.told:.3g}" if found.told is not None else ""
    return Cell(**at, verdict=verdict, message=message, warned=_texts(heard), **vars(found))


def _reported(verdict: CellVerdict, error: Exception) -> CellVerdict:
    """A refusal must be one line that says something."""
    text = str(error)
    return verdict if text and "\n" not in text else CellVerdict.WRONG


def _texts(heard: list[warnings.WarningMessage]) -> tuple[str, ...]:
    """The warnings meant for users about the run; what is odd about its scene states no error."""
    about = [w for w in heard if not issubclass(w.category, PlausibilityWarning)]
    return tuple(str(w.message) for w in about if issubclass(w.category, UserWarning))


def against(samples: np.ndarray, exact: float, *, predicted: float = 0.0) -> Deviation:
    """Relative error of the mean of independent `samples` (n,), whose exact mean is `exact`."""
    mean, spread = float(np.mean(samples)), float(np.std(samples)) / math.sqrt(len(samples))
    return Deviation(error=mean / exact - 1.0, standard_error=spread / abs(exact), predicted=predicted)
