"""What is measured of a scene, by how much a time step makes it wrong, and how long a step the wanted accuracy allows.

Whatever a step may falsify has a row here: a word of `OBSERVABLES`, and an `Observable` in what `time_scales` gathers.
Rows of one name are one observable with several causes: the largest error counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

from otwarp.kernels.integrate.integrators import Integrator

OBSERVABLES: dict[str, str] = {
    "variance": "stationary variances in traps",
    "correlation": "relaxation rates and correlations in traps",
    "displacement": "mean squared displacements in traps over one step",
    "escape": "escape times and survival in traps",
    "orientation": "rates at which orientations decorrelate",
    "axis": "mean squared displacements along a body's axes over one step",
    "commands": "mean forces of traps that vary within a step",
    "obstacles": "ways of obstacles within a step",
    "wall": "distribution next to hydrodynamic walls",
}
"""Keys of `TimeScales.errors`, in the order in which they are printed, and what they are."""


@dataclass(frozen=True, kw_only=True)
class Observable:
    """One thing that a step may make wrong.

    Attributes:
        name: Of `OBSERVABLES`.
        error: Step [s] → estimated relative error; with its sign where that is known, else positive.
        longest: Longest step that keeps it within the wanted accuracy [s]; inf where no step is asked to, because none
            would or because it would cost too much: the error is then told all the same.
        limit: What is reported where `longest` decides the step.
    """

    name: str
    error: Callable[[float], float]
    longest: float
    limit: str


def errors(watched: Iterable[Observable], step: float) -> dict[str, float]:
    """Estimated relative errors with a step [s], by the names of `OBSERVABLES`, of what a scene has of them."""
    found: dict[str, float] = {}
    for observable in watched:
        error = observable.error(step)
        if abs(error) >= abs(found.get(observable.name, 0.0)):
            found[observable.name] = error
    return {name: found[name] for name in OBSERVABLES if name in found}


def in_springs(
    scheme: Integrator, rate: float, accuracy: float, noise: str, *, brownian: bool = True
) -> list[Observable]:
    """What is known in closed form of a spring that relaxes at `rate` [1/s]; it bounds all slower ones."""
    if rate <= 0.0:
        return []
    longest = scheme.largest_product(accuracy, noise) / rate
    limit = "trap relaxation and wanted accuracy"
    known = {"correlation": scheme.rate_error}
    if brownian:
        known |= {"variance": scheme.variance_error, "displacement": scheme.displacement_error}
    return [
        Observable(name=name, error=partial(_of_product, error, rate), longest=longest, limit=limit)
        for name, error in known.items()
    ]


def on_steep_sides(scheme: Integrator, steep: float, accuracy: float, noise: str) -> Observable:
    """Escapes, which are decided where forces are steepest: there a bead would relax at `steep` [1/s]."""
    return Observable(
        name="escape",
        error=partial(_of_product, partial(scheme.rim_error, noise=noise), steep),
        longest=scheme.rim_product(accuracy, noise) / steep if steep > 0.0 else math.inf,
        limit="steepest slope of a trap's force",
    )


def near_walls(longest: float, accuracy: float) -> Observable:
    """Heights above hydrodynamic walls, whose error is the wanted accuracy with the step `longest` [s]."""
    return Observable(
        name="wall",
        error=lambda step: accuracy * step / longest,
        longest=longest,
        limit="motion near hydrodynamic walls and wanted accuracy",
    )


def _of_product(error: Callable[[float], float], rate: float, step: float) -> float:
    return error(rate * step)
