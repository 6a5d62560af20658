"""What a sweep of SIMULATED operators has found: maps over delay and error, each cell against two others.

A cell is set, operator by operator, against the same operators with perfect perception, and without haptics. Intervals
are of 95 %, and say how well so many simulated operators tell what the model does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.operators import statistics
from otwarp.operators.folder import Folder
from otwarp.operators.perception.errors import Perception
from otwarp.operators.perception.folder import probes_of
from otwarp.operators.perception.probe import FREQUENCIES
from otwarp.operators.perception.sweep import AXES
from otwarp.operators.statistics import Estimate
from otwarp.operators.task import ESCAPED, LEFT_BEHIND, REACHED

NUMBERS = {
    "force_rmse_pn": ("force error", "pN"),
    "force_rmse": ("force error at the hand", "N"),
    "force_r2": ("R² of the force", "1"),
    "direction_error": ("error of the force's direction", "°"),
    "warned": ("time in which a perfect twin warns", "s"),
    "missed": ("of that, not warned", "s"),
    "false": ("time of false warnings", "s"),
    "work": ("work done on the hands", "J"),
    "work_peak": ("most work done on the hands at any time", "J"),
    "contact_mean": ("mean contact force on the cell", "pN"),
    "contact_peak": ("peak contact force on the cell", "pN"),
    "time": ("time until the end", "s"),
    "slowed": ("time slowed by force", "s"),
}
"""Means over the operators of a cell, with meaning and unit."""
COMPARED = {"success": ("deliveries", 1.0), "contact_mean": ("mean contact force on the cell", -1.0)}
"""What cells are compared by, and the sign of what is better."""
MARGIN = {"success": 0.1, "contact_mean": 0.5}
"""By how much a cell may be worse than no error and still be as good: one delivery in ten [1], and a twentieth of the
contact warning of the shipped delivery, 10 pN [pN]. Chosen, not measured; 18 operators or more can show the first."""
AS_GOOD, WORSE, WORSE_THAN_NONE, UNTOLD = "as good as no error", "worse", "worse than no haptics", "not told"
"""What a cell may be, see `verdict`."""


@dataclass(frozen=True)
class Maps:
    """A sweep as arrays over its grid.

    Attributes:
        axes: Values of `sweep.AXES` by name, in the order of the arrays' dimensions.
        maps: Arrays over the grid by name: success and lost, rates; `NUMBERS`; of the probes phase_1hz [°], gain_1hz
            and so on, sway [m], limit_cycles (share of hands), limit_cycle_hz; success_minus_perfect,
            success_minus_without, and the same of all `COMPARED`. Rates and differences have ends of their intervals,
            with _low and _high behind the name.
        beside: The same numbers, without differences, of perfect perception, "perfect", and of no haptics, "without".
        operators: How many have done all of it.
        asked: What `study.json` says.
    """

    axes: dict[str, np.ndarray]
    maps: dict[str, np.ndarray]
    beside: dict[str, dict[str, float]]
    operators: int
    asked: dict[str, Any]

    def at(self, cell: tuple[int, ...]) -> dict[str, float]:
        """All numbers of a cell of the grid."""
        return {name: float(values[cell]) for name, values in self.maps.items()}


def maps_of(folder: Folder) -> Maps:
    """The maps of a sweep, of the operators that have done all of it so far.

    Raises:
        InputError: Nothing is computed yet.
    """
    asked = folder.asked()
    said = asked["perception"]
    axes = {name: np.array(said["axes"][name]) for name in AXES if name in said["axes"]}
    shape = tuple(len(values) for values in axes.values())
    cells = int(np.prod(shape))
    blind = Perception(**said["base"]).eyes == "twin"
    table = _by_arm(folder.read(), 2 + cells * (1 + blind))
    columns = [_numbers(table, 2 + n) for n in range(cells)]
    for n, column in enumerate(columns):
        column |= _differences(table, 2 + n, 1, "perfect") | _differences(
            table, 2 + n, 2 + cells + n if blind else 0, "without"
        )
    probes = _probed(probes_of(folder), cells + 1)
    maps = {name: np.array([c[name] for c in columns]).reshape(shape) for name in columns[0]}
    maps |= {name: row[1:].reshape(shape) for name, row in probes.items()}
    beside = {"without": _numbers(table, 0), "perfect": _numbers(table, 1)}
    beside["perfect"] |= {name: float(row[0]) for name, row in probes.items()}
    return Maps(axes, maps, beside, table["outcome"].shape[1], asked)


def _by_arm(arrays: dict[str, np.ndarray], arms: int) -> dict[str, np.ndarray]:
    """(arms, operators) of the operators of whom there are all arms; none is an array of no columns."""
    number = arrays["operator"] * arms + arrays["arm"]
    order = np.argsort(number)
    whole = len(order) // arms * arms
    return {name: row[order][:whole].reshape(-1, arms).T for name, row in arrays.items()}


def _numbers(table: dict[str, np.ndarray], arm: int) -> dict[str, float]:
    """Rates and means of an arm."""
    outcome = table["outcome"][arm]
    out: dict[str, float] = {}
    for name, made in (("success", outcome == REACHED), ("lost", np.isin(outcome, (ESCAPED, LEFT_BEHIND)))):
        out |= _spread(name, statistics.rate(made))
    return out | {name: _mean(table[name][arm]) for name in NUMBERS}


def _mean(row: np.ndarray) -> float:
    """Mean of what is known."""
    known = row[np.isfinite(row)]
    return float(known.mean()) if len(known) else np.nan


def _differences(table: dict[str, np.ndarray], arm: int, other: int, name: str) -> dict[str, float]:
    """An arm less another one, operator by operator."""
    made = table["outcome"] == REACHED
    found = {"success": statistics.risk_difference(made[arm], made[other])}
    found["contact_mean"] = statistics.mean_difference(table["contact_mean"][arm], table["contact_mean"][other])
    out: dict[str, float] = {}
    for what, row in found.items():
        out |= _spread(f"{what}_minus_{name}", row)
    return out


def _spread(name: str, row: Estimate) -> dict[str, float]:
    """An estimate as three numbers."""
    return {name: row.value, f"{name}_low": row.low, f"{name}_high": row.high}


def _probed(probes: dict[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    """(count) means of what was probed: phases of the mean answer, so that noise does not turn them."""
    if not probes:
        return {}
    out: dict[str, np.ndarray] = {}
    answer = probes["gain"] * np.exp(1j * np.deg2rad(probes["phase"]))
    for n, frequency in enumerate(FREQUENCIES):
        known = answer[..., n].reshape(count, -1)
        mean = np.array([row[np.isfinite(row)].mean() if np.isfinite(row).any() else np.nan for row in known])
        out[f"phase_{frequency:g}hz"], out[f"gain_{frequency:g}hz"] = np.rad2deg(np.angle(mean)), np.abs(mean)
    sway = probes["sway"].reshape(count, -1)
    out["sway"] = np.array([_mean(row) for row in sway])
    if "cycle" in probes:  # folders of before know of none
        frequency, amplitude = (probes[name].reshape(count, -1) for name in ("cycle", "cycle_amplitude"))
        out["limit_cycles"] = np.array([_mean(np.where(np.isfinite(row), row > 0.0, np.nan)) for row in amplitude])
        out["limit_cycle_hz"] = np.array([_mean(row) for row in frequency])
    return out


def as_good(low: np.ndarray | float, high: np.ndarray | float, what: str) -> np.ndarray | float:
    """By how much more than `MARGIN` allows a cell may be worse than no error, below 0 where it is as good.

    That is one side of a test of equivalence (Schuirmann 1987, doi:10.1007/BF01068419): what is better is welcome.

    Args:
        low, high: Ends of the interval of a number of `COMPARED`, less that without error.
        what: Its name.
    """
    return (-low if COMPARED[what][1] > 0.0 else high) - MARGIN[what]


def verdict(row: dict[str, float], what: str) -> str:
    """What a cell is by one of `COMPARED`, by intervals of 95 %.

    "worse than no haptics"; "as good as no error", where it is worse by less than `MARGIN`; "worse" than no error by
    more than that, or by something; "not told", where so many simulated operators leave both open.
    """
    sign = COMPARED[what][1]
    end = "_high" if sign > 0.0 else "_low"
    below = {name: sign * row[f"{what}_minus_{name}{end}"] < 0.0 for name in ("perfect", "without")}
    if below["without"]:
        return WORSE_THAN_NONE
    if as_good(row[f"{what}_minus_perfect_low"], row[f"{what}_minus_perfect_high"], what) < 0.0:
        return AS_GOOD
    return WORSE if below["perfect"] else UNTOLD
