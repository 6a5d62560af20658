"""What a study of SIMULATED operators has found, as plain data, beside what is published of people."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from otwarp.operators import statistics
from otwarp.operators.folder import Folder
from otwarp.operators.population import read_population
from otwarp.operators.statistics import Estimate
from otwarp.operators.task import OUTCOMES, REACHED

MEASURES = {
    "time": ("time until the end", "s"),
    "contact_mean": ("mean contact force on the cell", "pN"),
    "contact_peak": ("peak contact force on the cell", "pN"),
    "contact_above": ("time above the contact warning", "s"),
    "distance_mean": ("mean distance of spheres from traps", "µm"),
    "distance_peak": ("largest distance of a sphere from its trap", "µm"),
    "distance_above": ("time above the distance warning", "s"),
}
"""What is compared between conditions, with its meaning and unit; less is better."""
FELT = {
    "force_mean": ("mean force on a hand", "N"),
    "force_peak": ("peak force on a hand", "N"),
    "work": ("work done on the hands", "J"),
    "work_peak": ("most work done on the hands at any time", "J"),
    "waited": ("time of waiting by eye", "s"),
    "slowed": ("time slowed by force", "s"),
    "progress": ("part of the path that was gone", "1"),
}
"""What else is told of each condition."""

PAPER = {"with": (8, 10), "without": (3, 10), "contact": {"with": (2.57, 3.18), "without": (5.39, 6.78)}}
"""The paper's ten trials of each kind: deliveries, and contact force on the cell, mean and deviation [pN]."""
LITERATURE = {
    "Bergholz 2023 (PMC10628231), success": Estimate(0.80, np.nan, np.nan),
    "Bergholz 2023 (PMC10628231), average force": Estimate(0.83, 0.66, 1.01),
    "Bergholz 2023 (PMC10628231), kinesthetic feedback": Estimate(0.96, 0.75, 1.18),
    "Weber and Eichberger 2015, time": Estimate(0.22, np.nan, np.nan),
}
"""Standardised differences of people with and without haptics in meta-analyses, above 0 where haptics are better."""


def summarise(folder: Folder) -> dict[str, Any]:
    """All that the study in a folder tells so far, for JSON; numbers that do not exist are None.

    Raises:
        InputError: Nothing is computed yet.
    """
    asked, arrays = folder.asked(), folder.read()
    conditions = asked["conditions"]
    made = arrays["outcome"] == REACHED
    rates = {name: statistics.rate(made[i]) for i, name in enumerate(conditions)}
    found: dict[str, Any] = {
        "simulated": True,
        "note": "simulated operators; nothing here was measured on people",
        "scene": asked["scene"]["file"],
        "population sha256": asked["population"],
        "operators": int(made.shape[1]),
        "operators asked": asked["operators"],
        "seed": asked["seed"],
        "mode": asked["mode"],
        "force gain": asked["force gain"],
        "motion gain": asked["motion gain"],
        "duration": asked["duration"],
        "success": {name: asdict(rate) for name, rate in rates.items()},
        "outcomes": {name: _outcomes(arrays["outcome"][i]) for i, name in enumerate(conditions)},
        "numbers": {name: _numbers(arrays, i) for i, name in enumerate(conditions)},
        "compared": {},
        "paper": _paper(),
        "literature": {name: asdict(row) for name, row in LITERATURE.items()},
    }
    for better, worse in (("with", "without"), ("no response", "without"), ("with", "no response")):
        if better in conditions and worse in conditions:
            pair = conditions.index(better), conditions.index(worse)
            found["compared"][f"{better} − {worse}"] = _compared(arrays, *pair)
    if "with" in rates and "without" in rates:
        small = statistics.small_study(rates["with"], rates["without"])
        found["small study"] = {"at least 8 and at most 3 of 10": asdict(small.at_least), "exactly": small.exactly}
    if asked["sobol"]:
        found["sobol"] = _sobol(folder, arrays, conditions)
    return _plain(found)


def _outcomes(codes: np.ndarray) -> dict[str, int]:
    """How often each outcome came."""
    return {said: int(np.sum(codes == code)) for code, said in OUTCOMES.items()}


def _numbers(arrays: dict[str, np.ndarray], condition: int) -> dict[str, dict[str, float]]:
    """Mean and deviation of every number, of all trials and of those that delivered."""
    made = arrays["outcome"][condition] == REACHED
    out = {}
    for name in (*MEASURES, *FELT):
        row = np.asarray(arrays[name][condition], dtype=float)
        out[name] = {
            "mean": float(row.mean()),
            "deviation": _deviation(row),
            "mean of delivered": float(row[made].mean()) if made.any() else np.nan,
            "deviation of delivered": _deviation(row[made]),
        }
    return out


def _deviation(row: np.ndarray) -> float:
    return float(row.std(ddof=1)) if len(row) > 1 else np.nan


def _compared(arrays: dict[str, np.ndarray], better: int, worse: int) -> dict[str, Any]:
    """One condition against another, operator by operator."""
    made = arrays["outcome"] == REACHED
    both = made[better] & made[worse]
    out: dict[str, Any] = {
        "risk difference": asdict(statistics.risk_difference(made[better], made[worse])),
        "p": statistics.mcnemar(made[better], made[worse]),
        "pairs": int(made.shape[1]),
        "better": int(np.sum(made[better] & ~made[worse])),
        "worse": int(np.sum(~made[better] & made[worse])),
        "g of success": statistics.rate_as_g(made[better].mean(), made[worse].mean(), made.shape[1]),
        "pairs that both delivered": int(both.sum()),
        "g": {},
        "g where both delivered": {},
    }
    for name in MEASURES:
        rows = arrays[name][[better, worse]].astype(float)
        if rows.shape[1] > 2 and name != "time":  # a trial that is lost is over soon
            out["g"][name] = asdict(statistics.hedges_g(rows[0], rows[1]))
        if both.sum() > 2:
            out["g where both delivered"][name] = asdict(statistics.hedges_g(rows[0, both], rows[1, both]))
    return out


def _paper() -> dict[str, Any]:
    """The paper's own ten trials of each kind, as rates and as a standardised difference."""
    made, trials = PAPER["with"]
    others, _ = PAPER["without"]
    rates = {
        name: asdict(statistics.rate(np.arange(trials) < count))
        for name, count in (("with", made), ("without", others))
    }
    return {**rates, "g of success": statistics.rate_as_g(made / trials, others / trials, trials),
            "contact": PAPER["contact"]}  # fmt: skip


def _sobol(folder: Folder, arrays: dict[str, np.ndarray], conditions: list[str]) -> dict[str, Any]:
    """Indices of the population's parameters, of whole rows of Saltelli's points."""
    population = read_population((folder.path / "population.toml").read_bytes())
    width = len(population.parameters) + 2
    rows = _whole_rows(arrays["operator"], width)
    made = (arrays["outcome"] == REACHED).astype(float)
    numbers = {f"success {name}": made[i] for i, name in enumerate(conditions)}
    if "with" in conditions and "without" in conditions:
        pair = conditions.index("with"), conditions.index("without")
        numbers["success with − without"] = made[pair[0]] - made[pair[1]]
        numbers["contact with − without"] = arrays["contact_mean"][pair[0]] - arrays["contact_mean"][pair[1]]
    out: dict[str, Any] = {"rows": int(rows.sum()), "parameters": list(population.names), "indices": {}}
    if rows.sum() > 1:
        for name, row in numbers.items():
            table = row[np.repeat(rows, width)[: len(row)]].reshape(-1, width)
            found = statistics.sobol(table)
            out["indices"][name] = {k: np.asarray(v).tolist() for k, v in asdict(found).items()}
    return out


def _whole_rows(operators: np.ndarray, width: int) -> np.ndarray:
    """Flags of the rows of which all points are there; points are in order, so that only the last can be cut."""
    count = -(-len(operators) // width)
    return np.arange(1, count + 1) * width <= len(operators)


def _plain(value: Any) -> Any:
    """The same with None for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
