"""What is asked of a trial: what ended it and when, and numbers that are read along its way.

A trial ends when one of the study's ends comes first, or at its horizon. Escapes are known to the step in which they
happened; all else is looked at every `every` seconds of the study.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from otwarp.errors import InputError
from otwarp.kernels.drivers import numbers
from otwarp.kernels.drivers.episodes import WorldFunction
from otwarp.kernels.drivers.observations import REDUCTIONS
from otwarp.scene import Scene
from otwarp.simulation.ends import End, escaped, reached
from otwarp.simulation.packing.bodies import is_rigid
from otwarp.studies.functions import world_function
from otwarp.studies.quantity import quantity

BODY_OF = {numbers.contact_force: 0, numbers.orientation_error: 4, numbers.place: 0}
"""Shipped functions of a body, and which of their values is its index."""

Kind = Literal["probability", "time", "number", "choice"]


@dataclass(frozen=True, eq=False)
class Observable:
    """Something asked of every trial.

    Attributes:
        name: In tables.
        kind: `probability` of what happened by `until`, `time` until it happened, a `number` of the trial, or a
            `choice`: which of several things it was.
        end: What must happen for it; None for a number or a choice.
        happens: Whether the trial counts where that happens, or where it does not.
        until: By when [s]; None for the study's horizon.
        function: How a number is read.
        keep: What is kept of its course, one of `REDUCTIONS`.
        values: Parameters of the function, by name.
        unit: Of the number.
        measured: Whether it needs trap forces, which are evaluated only where somebody asks.
        choices: Names of the things that the function's numbers 0, 1, … stand for; without a function, of the ends.
    """

    name: str
    kind: Kind
    end: End | None = None
    happens: bool = True
    until: float | None = None
    function: WorldFunction | None = None
    keep: str = "last"
    values: tuple[float, ...] = ()
    unit: str = ""
    measured: bool = False
    choices: tuple[str, ...] = ()

    def called(self, name: str) -> Observable:
        """The same under another name."""
        return dataclasses.replace(self, name=name)


@dataclass(frozen=True, eq=False)
class OfScene:
    """An observable that is known when its scene is: `made` gives it."""

    made: Callable[[Scene], Observable]


def trapped(*, until: float) -> Observable:
    """Whether no trap has lost its sphere by `until` [s], a number or a text with its unit.

    Raises:
        InputError: A time that is not above 0.
    """
    return Observable("trapped", "probability", end=escaped, happens=False, until=check_time("until", until))


def lost(*, until: float) -> Observable:
    """Whether some trap has lost its sphere by `until` [s], a number or a text with its unit.

    Raises:
        InputError: A time that is not above 0.
    """
    return Observable("lost", "probability", end=escaped, until=check_time("until", until))


def first_passage(end: End = escaped) -> Observable:
    """When an end comes, the escape of a trap's sphere if none is named; trials that go on are censored."""
    return Observable("first_passage" if end is escaped else f"time_to_{end.name}", "time", end=end)


def delivered(goal: Sequence[float] | None = None, *, radius: float | None = None, body: int = 0, until: float) -> Any:
    """Whether a body has come within `radius` of `goal` in time, before any trap has lost its sphere.

    Args:
        goal: Place of the body's centre of diffusion [µm]; None: the scene's goal, tolerance and cell.
        radius: Distance from it that will do [µm]; with a goal alone.
        body: Index of the body, with a goal alone.
        until: Time by which it must be there [s], a number or a text with its unit.

    Raises:
        InputError: A goal without a radius, or a time that is not above 0; of a scene without a goal, when it is known.
    """
    by = check_time("until", until)
    if goal is None:
        return OfScene(lambda scene: _delivered(*_goal(scene), by))
    if radius is None:
        raise InputError("delivered has a goal and no radius; allowed: both, or neither for the scene's own goal")
    return _delivered(tuple(goal), radius, body, by)


def _delivered(goal: Sequence[float], radius: float, body: int, until: float) -> Observable:
    return Observable("delivered", "probability", end=reached(goal=list(goal), radius=radius, body=body), until=until)


def _goal(scene: Scene) -> tuple[Sequence[float], float, int]:
    """The scene's goal, its tolerance, and which body is to come there."""
    if scene.goal is None:
        raise InputError(f"{scene.file or scene.root}: delivered: the scene has no goal; allowed: goal and radius")
    names = [b.prim for b in scene.bodies]
    return scene.goal.position, scene.goal.tolerance, names.index(scene.goal.cell)


def observable(keep: str = "last", *, unit: str = "", measured: bool = False) -> Callable[[Callable[..., Any]], Any]:
    """Make an observable of a function: a number that is read of each world along its way.

    The function is Warp code `(now: otwarp.WorldNow, *parameters) -> float`; parameters are annotated as `float`, `int`
    or `wp.vec3` and are given when it is used, or have defaults.

    Args:
        keep: What of the number's course is the trial's: last, largest, least, mean, or integral over time.
        unit: Its unit, for tables; of an integral, with the second.
        measured: Whether it reads forces or distances of traps.

    Raises:
        InputError: The function is no such function.

    Example:
        >>> @ot.observable(keep="largest", unit="pN")
        ... def squeeze(now: ot.WorldNow, body: int = 0) -> float:
        ...     return now.readout.contact_load[now.world, body]
    """
    if keep not in REDUCTIONS:
        raise InputError(f"keep is {keep!r}; allowed: {', '.join(REDUCTIONS)}")

    def made(function: Callable[..., Any]) -> Callable[..., Observable]:
        """What makes observables of the function, for the values of its parameters."""
        read, row = world_function("observable", function)

        def given(**values: Any) -> Observable:
            """The observable with these values; replaced by the function's own text."""
            return Observable(
                function.__name__, "number", function=read, keep=keep, values=row(values), unit=unit, measured=measured
            )

        given.__name__, given.__doc__ = function.__name__, function.__doc__
        given.makes_observable = True  # type: ignore[attr-defined]
        return given

    return made


contact_force = observable(keep="largest", unit="pN")(numbers.contact_force)
"""Sum of the normal forces on `body` (its index, 0 if not given), the largest of the trial."""


def contact_dose(body: int = 0) -> Observable:
    """Sum of the normal forces on `body` (its index, 0 if not given), integrated over the trial [pN·s]."""
    return dataclasses.replace(contact_force(body=body), name="contact_dose", keep="integral", unit="pN·s")


orientation_error = observable(keep="last", unit="rad")(numbers.orientation_error)
"""Angle between the orientation of `body` and a wanted one, a quaternion (x, y, z, w), at the end of the trial."""


def check_observables(given: Sequence[Any], scene: Scene) -> tuple[Observable, ...]:
    """The observables of a study, those that wait for its scene made.

    Raises:
        InputError: None at all, something else, one without what it needs, or a name twice.
    """
    found: list[Observable] = []
    for item in given if isinstance(given, list | tuple) else [given]:
        made = item
        # `contact_force`, or `delivered` by the scene's own goal: what needs a scene, or nothing
        if isinstance(made, OfScene):
            made = made.made(scene)
        elif not isinstance(made, Observable) and callable(made):
            if wanted := missing(made, ()):
                name = getattr(made, "__name__", repr(made))
                raise InputError(f"observables hold {name} without {wanted[0]}; allowed: {name}({wanted[0]}=…)")
            made = made()
        if not isinstance(made, Observable):
            raise InputError(f"observables hold {item!r}; allowed: trapped(until=…), first_passage(), … or one's own")
        _check_body(made, scene)
        found.append(made)
    names = [o.name for o in found]
    if not found or len(set(names)) < len(names):
        again = next((n for n in names if names.count(n) > 1), None)
        raise InputError(f"observables are {', '.join(names) or 'none'}; allowed: one or more"
                         f"{f', {again} once or under another name' if again else ''}")  # fmt: skip
    return tuple(found)


def missing(make: Callable[..., Any], given: Collection[str]) -> list[str]:
    """Names of parameters that have no default and are not given.

    Args:
        make: What makes an observable.
        given: Names of those that are.
    """
    try:
        parameters = inspect.signature(make).parameters.values()
    except (TypeError, ValueError):  # of a builtin function
        return []
    wanted = [p for p in parameters if p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    return [p.name for p in wanted if p.name not in given]


def _check_body(asked: Observable, scene: Scene) -> None:
    """Refuse a number of a body that the scene does not have, or that does not turn: kernels look at no bounds."""
    read = None if asked.function is None else asked.function.function
    if read not in BODY_OF:
        return
    body, bodies = asked.values[BODY_OF[read]], scene.bodies
    if body not in range(len(bodies)):
        raise InputError(f"{asked.name} has body = {body:g}; allowed: 0 … {len(bodies) - 1}, an index of the scene's")
    if read is numbers.orientation_error and not is_rigid(bodies[int(body)]):
        prim = bodies[int(body)].prim
        raise InputError(f"{asked.name}: {prim} is one sphere, which has no orientation; allowed: a body that turns")


def same_end(a: End, b: End) -> bool:
    """Whether two ends are one: the same predicate with the same parameters."""
    same = a.predicate == b.predicate and a.values.keys() == b.values.keys()
    return same and all(np.array_equal(np.asarray(v), np.asarray(b.values[k])) for k, v in a.values.items())


def check_time(name: str, value: Any) -> float:
    """A time, as a number [s] or a text with its unit.

    Raises:
        InputError: Anything else.
    """
    number = quantity(value, "s", name) if isinstance(value, str) else value
    real = isinstance(number, int | float | np.integer | np.floating) and not isinstance(number, bool)
    if not real or not 0.0 < number < float("inf"):
        raise InputError(f"{name} is {value!r}; allowed: a time above 0 s")
    return float(number)
