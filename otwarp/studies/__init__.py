"""Studies: trials of a scene at many points, how often what happens and when, with intervals; on any number of devices.

| file | what it holds |
|---|---|
| `study` | `Study`: what varies, what is asked, how many trials; open it first |
| `axes`, `quantity` | values along the dimensions of a study, their units |
| `targets`, `design` | what a name turns in a scene; the points, and the groups of them that share a model |
| `observables` | what is asked of a trial: ends, times, numbers |
| `runner` | trials on a device, a world each |
| `stopping`, `intervals` | how many trials a point gets; intervals of rates, survival |
| `store`, `results` | a study on disk; its results as a labelled table |
| `run`, `engines`, `estimate` | who computes what is missing, where, and how long that takes |
| `file`, `figure` | studies in TOML; pictures |

A trial has a number, and is the same bits for that number wherever and beside whatever it runs: so results do not
depend on batches, shards, order or interruptions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.studies.axes import Axis, Scatter, grid, normal, random, sobol, values
    from otwarp.studies.file import load_study
    from otwarp.studies.intervals import interval, survival
    from otwarp.studies.observables import (
        Observable,
        contact_dose,
        contact_force,
        delivered,
        first_passage,
        lost,
        observable,
        orientation_error,
        trapped,
    )
    from otwarp.studies.results import table
    from otwarp.studies.run import run_study
    from otwarp.studies.stopping import Stop, half_width, trials
    from otwarp.studies.store import Store, open_store
    from otwarp.studies.study import Plan, Study

_NAMES = {
    "axes": ("Axis", "Scatter", "grid", "normal", "random", "sobol", "values"),
    "file": ("load_study",),
    "intervals": ("interval", "survival"),
    "observables": (
        "Observable",
        "contact_dose",
        "contact_force",
        "delivered",
        "first_passage",
        "lost",
        "observable",
        "orientation_error",
        "trapped",
    ),
    "run": ("run_study",),
    "stopping": ("Stop", "half_width", "trials"),
    "store": ("Store", "open_store"),
    "study": ("Plan", "Study"),
    "results": ("table",),
}

__all__ = [
    "Axis",
    "Observable",
    "Plan",
    "Scatter",
    "Stop",
    "Store",
    "Study",
    "contact_dose",
    "contact_force",
    "delivered",
    "first_passage",
    "grid",
    "half_width",
    "interval",
    "load_study",
    "lost",
    "normal",
    "observable",
    "open_store",
    "orientation_error",
    "random",
    "run_study",
    "sobol",
    "survival",
    "table",
    "trapped",
    "trials",
    "values",
]

__getattr__, __dir__ = lazy_names(__name__, _NAMES)
