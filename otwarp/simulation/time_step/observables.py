"""What is measured of a scene, by how much a time step makes it wrong, and how long a step the wanted accuracy allows.

Whatever a step may falsify has a row here: a word of `OBSERVABLES`, and an `ErrorSource` in what `time_scales` gathers.
Rows of one name are one observable with several causes: the largest error counts.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial

from otwarp.errors import InputError
from otwarp.kernels.integrate.integrators import PROMISED, Integrator

OBSERVABLES: dict[str, str] = {
    "variance": "stationary variances in traps",
    "correlation": "relaxation rates and correlations in traps",
    "displacement": "mean squared displacements in traps over one step",
    "escape": "escape times and survival in traps",
    "contact": "gaps between bodies and what they are pressed on, at most",
    "orientation": "rates at which orientations decorrelate",
    "axis": "mean squared displacements along a body's axes over one step",
    "commands": "mean forces of traps that vary within a step",
    "obstacles": "ways of obstacles within a step",
    "wall": "distribution next to hydrodynamic walls",
}
"""Keys of `TimeScales.errors`, in the order in which they are printed, and what they are."""


LARGE = 0.1
"""Estimated relative error above which an explicit step is refused, unless the user insists."""


CLOSE, CLOSE_ORDER = 3.0, 1.5
"""How much shorter steps are where beads start close to the end of a trap, at an accuracy of 1 %, and the power of the
step with which survival from there errs at most: found with `python -m benchmarks --only time_step`."""


@dataclass(frozen=True, kw_only=True)
class ErrorSource:
    """One way in which a step makes an observable wrong.

    Attributes:
        name: Of `OBSERVABLES`.
        error: Step [s] → estimated relative error; with its sign where that is known, else positive.
        longest: Longest step that keeps it within the wanted accuracy [s]; inf where no step is asked to, because none
            would or because it would cost too much: the error is then reported all the same.
        limit: What is reported where `longest` decides the step.
    """

    name: str
    error: Callable[[float], float]
    longest: float
    limit: str


def errors(watched: Iterable[ErrorSource], step: float) -> dict[str, float]:
    """Estimated relative errors with a step [s], by the names of `OBSERVABLES`, of what a scene has of them."""
    found: dict[str, float] = {}
    for observable in watched:
        error = observable.error(step)
        if abs(error) >= abs(found.get(observable.name, 0.0)):
            found[observable.name] = error
    return {name: found[name] for name in OBSERVABLES if name in found}


def spelled(errors: Mapping[str, float | None], least: float = 0.0) -> str:
    """Errors in words, `stationary variances in traps −0.43 %, …`, those below `least` together; empty for none."""
    small = [name for name, error in errors.items() if error is not None and abs(error) < least]
    words = [f"{OBSERVABLES[name]} {percent(error)}" for name, error in errors.items() if name not in small]
    if small:
        words.append(f"{'the others' if words else 'all'} below {100.0 * least:g} %")
    return ", ".join(words)


def percent(error: float | None) -> str:
    """A relative error; None and what is not finite stand for a step that is not stable."""
    if error is None or not math.isfinite(error):
        return "unstable"
    return f"{100.0 * error:+.2g} %".replace("-", "−")


def missed(errors: Mapping[str, float], accuracy: float) -> dict[str, float]:
    """Those of the errors that are larger than the wanted accuracy."""
    return {name: error for name, error in errors.items() if abs(error) > accuracy * (1.0 + 1e-9)}


@dataclass(frozen=True, kw_only=True)
class ExplicitStep:
    """A time step that a scene or its user asks for.

    Attributes:
        step: [s].
        what: What messages call it.
        allow_large: Whether it may make any errors, if it is stable.
    """

    step: float
    what: str = "time step"
    allow_large: bool = False

    def check(self, watched: list[ErrorSource], accuracy: float) -> None:
        """Warn of a step that misses the wanted accuracy; refuse one that errs by `LARGE`.

        What no step makes right within reason is reported with every step, and so does not count.

        Raises:
            InputError: An error above `LARGE` and the wanted accuracy; the message names the longest step without.
        """
        if self.allow_large:
            return
        curable = [row for row in watched if self.step > row.longest]
        above = missed(errors(curable, self.step), accuracy)
        if not above:
            return
        limit, best = max(LARGE, accuracy), min(row.longest for row in curable)
        large, asked = missed(above, limit), f"{self.what} {self.step:g} s"
        if large:
            raise InputError(
                f"{asked} makes large errors: {spelled(large)}; allowed: up to "
                f"{longest_within(curable, limit, self.step):.4g} s for {100.0 * limit:g} % ({best:.4g} s for the "
                f"wanted {100.0 * accuracy:g} %), or any stable one with --allow-large-step (allow_large_step=True in "
                "Python)"
            )
        warnings.warn(
            f"{asked} misses the wanted accuracy of {100.0 * accuracy:g} %, estimated errors: {spelled(above)}; "
            f"within it: up to {best:.4g} s",
            stacklevel=4,
        )


def longest_within(watched: list[ErrorSource], error: float, step: float) -> float:
    """Longest step up to `step` [s] with which no estimated error exceeds `error`; errors grow with the step."""
    low, high = 0.0, step
    for _ in range(50):
        middle = 0.5 * (low + high)
        good = all(abs(row.error(middle)) <= error for row in watched)
        low, high = (middle, high) if good else (low, middle)
    return low


def in_springs(
    scheme: Integrator, rate: float, accuracy: float, noise: str, *, brownian: bool = True
) -> list[ErrorSource]:
    """What is known in closed form of a spring that relaxes at `rate` [1/s]; it bounds all slower ones."""
    if rate <= 0.0:
        return []
    longest = scheme.largest_product(accuracy, noise) / rate
    known = {"correlation": scheme.rate_error}
    if brownian:
        known |= {"variance": scheme.variance_error, "displacement": scheme.displacement_error}
    return [
        ErrorSource(
            name=name,
            error=partial(_of_product, error, rate),
            longest=longest if scheme.vanishes(error) else math.inf,
            limit="trap relaxation and wanted accuracy",
        )
        for name, error in known.items()
    ]


def at_edges(scheme: Integrator, steep: float, accuracy: float, noise: str) -> list[ErrorSource]:
    """Escapes, which are decided where forces are steepest: there a bead would relax at `steep` [1/s].

    What crossings between steps and cheaper noise make wrong is reported, but steps are not shortened for it.
    """
    if steep <= 0.0:
        return []
    limit = "force where beads leave a trap"
    longest = scheme.rim_product(accuracy, noise) / steep
    curable, lasting = (
        partial(_of_product, e, steep) for e in (scheme.rim_error, partial(scheme.lasting_error, noise=noise))
    )
    return [
        ErrorSource(name="escape", error=curable, longest=longest, limit=limit),
        ErrorSource(name="escape", error=lasting, longest=math.inf, limit=limit),
    ]


def from_close(scheme: Integrator, steep: float, accuracy: float, noise: str) -> list[ErrorSource]:
    """Survival of beads that start or are left close to where a trap ends, where they would relax at `steep` [1/s].

    It is decided within few steps, and not averaged over many as an escape is; so it errs more, and falls more slowly.
    """
    if steep <= 0.0:
        return []
    order = 1.0 if noise == "uniform" else min(scheme.weak_order, CLOSE_ORDER)
    product = scheme.rim_product(0.01, noise) / CLOSE
    return [
        ErrorSource(
            name="escape",
            error=lambda step: PROMISED * 0.01 * (steep * step / product) ** order,
            longest=product * (accuracy / 0.01) ** (1.0 / order) / steep,
            limit="start or lag close to where a trap ends",
        )
    ]


def near_walls(longest: float, accuracy: float) -> ErrorSource:
    """Heights above hydrodynamic walls, whose error is the wanted accuracy with the step `longest` [s]."""
    return ErrorSource(
        name="wall",
        error=lambda step: accuracy * step / longest,
        longest=longest,
        limit="motion near hydrodynamic walls and wanted accuracy",
    )


def _of_product(error: Callable[[float], float], rate: float, step: float) -> float:
    return error(rate * step)
