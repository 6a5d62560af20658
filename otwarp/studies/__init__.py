"""Studies: trials of a scene at many points, how often what happens and when, with intervals; on any number of devices.

| file | what it holds |
|---|---|
| `study`, `any_study` | `Study`: what varies, what is asked, how many trials; open it first; what others need of it |
| `axes`, `quantity` | values along the dimensions of a study, their units |
| `targets`, `design` | what a name turns in a scene; the points, and the groups of them that share a model |
| `observables`, `outcomes` | what is asked of a trial: ends, times, numbers; why and where it ended |
| `named`, `functions` | observables as files name them, those of a user's own file; functions of users |
| `runner`, `rows`, `rerun` | trials on a device, a world each; their parameters and starts; one of them run again |
| `stopping` | how many trials a point gets, and the intervals that decide it |
| `plan`, `compute`, `asked` | what a study will take; blocks of it computed; what its store says of it |
| `store`, `results` | a study on disk; its results as a labelled table |
| `differences`, `damage` | how another study differs from that of a folder; what a folder has lost |
| `engines` | who computes what is missing, and where: this process, shards, Ray |
| `file` | studies in TOML |
| `figure`, `survival_figure`, `contours` | pictures; survival curves; lines of a map where a probability has a level |
| `rare` | rates of escapes that are too rare to be waited for: `EscapeStudy` |

A trial has a number, and is the same bits for that number wherever and beside whatever it runs: so results do not
depend on batches, shards, order or interruptions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.studies.axes import Axis, Scatter, grid, normal, random, sobol, values
    from otwarp.studies.contours import contour_lines
    from otwarp.studies.engines.run import run_study
    from otwarp.studies.file import load_study
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
    from otwarp.studies.outcomes import first_lost, left_behind, outcome, place
    from otwarp.studies.plan import Plan
    from otwarp.studies.rare.orders import Order, distance, energy, order
    from otwarp.studies.rare.study import EscapePlan, EscapeStudy
    from otwarp.studies.results import table
    from otwarp.studies.stopping.contour import contour
    from otwarp.studies.stopping.intervals import interval, survival
    from otwarp.studies.stopping.rules import Stop, budget, half_width, trials
    from otwarp.studies.stopping.search import largest, largest_in
    from otwarp.studies.store import Store, open_store
    from otwarp.studies.study import Study

_NAMES = {
    "axes": ("Axis", "Scatter", "grid", "normal", "random", "sobol", "values"),
    "contours": ("contour_lines",),
    "file": ("load_study",),
    "stopping.intervals": ("interval", "survival"),
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
    "engines.run": ("run_study",),
    "outcomes": ("first_lost", "left_behind", "outcome", "place"),
    "plan": ("Plan",),
    "stopping.search": ("largest", "largest_in"),
    "stopping.contour": ("contour",),
    "stopping.rules": ("Stop", "budget", "half_width", "trials"),
    "store": ("Store", "open_store"),
    "study": ("Study",),
    "rare.orders": ("Order", "distance", "energy", "order"),
    "rare.study": ("EscapePlan", "EscapeStudy"),
    "results": ("table",),
}

__all__ = [
    "Axis",
    "EscapePlan",
    "EscapeStudy",
    "Observable",
    "Order",
    "Plan",
    "Scatter",
    "Stop",
    "Store",
    "Study",
    "budget",
    "contact_dose",
    "contact_force",
    "contour",
    "contour_lines",
    "delivered",
    "distance",
    "energy",
    "first_lost",
    "first_passage",
    "grid",
    "half_width",
    "interval",
    "largest",
    "largest_in",
    "left_behind",
    "load_study",
    "lost",
    "normal",
    "observable",
    "open_store",
    "order",
    "orientation_error",
    "outcome",
    "place",
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
