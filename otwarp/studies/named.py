"""Observables as study files name them: by `kind`, or a function in a file of one's own, loaded where it is named."""

from __future__ import annotations

import difflib
import hashlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from otwarp.errors import InputError
from otwarp.simulation.ends import End
from otwarp.studies.observables import (
    Observable,
    OfScene,
    contact_dose,
    contact_force,
    delivered,
    first_passage,
    lost,
    missing,
    orientation_error,
    trapped,
)
from otwarp.studies.outcomes import first_lost, left_behind, outcome, place
from otwarp.studies.quantity import quantity

NAMED: dict[str, Callable[..., Any]] = {
    "trapped": trapped,
    "lost": lost,
    "first_passage": first_passage,
    "delivered": delivered,
    "left_behind": left_behind,
    "first_lost": first_lost,
    "outcome": outcome,
    "place": place,
    "contact_force": contact_force,
    "contact_dose": contact_dose,
    "orientation_error": orientation_error,
}
"""Observables that a study file names by `kind`."""


def observable_of(given: dict[str, Any], what: str, folder: Path) -> Any:
    """An observable as a study file writes it: `kind`, or `file` and `function`, perhaps a `name`, and its parameters.

    Args:
        given: What the file says.
        what: Which it is, for messages.
        folder: From which `file` is seen.

    Raises:
        InputError: Anything else.
    """
    kind = given.get("kind")
    rest = {key: value for key, value in given.items() if key not in ("kind", "name", "file", "function")}
    if "file" in given or "function" in given:
        make = own_function(given, what, folder)
        allowed = "its parameters"
    elif kind in NAMED:
        make = NAMED[kind]
        allowed = ", ".join(inspect.signature(make).parameters)
    else:
        near = difflib.get_close_matches(str(kind), NAMED, n=1)
        raise InputError(f"{what} has the kind {kind!r}{f'; did you mean {near[0]}?' if near else ''}; "
                         f"allowed: {', '.join(NAMED)}, or file and function")  # fmt: skip
    if "until" in rest:
        rest["until"] = quantity(rest["until"], "s", f"until of {what}")
    if "radius" in rest and kind == "delivered":
        rest["radius"] = quantity(rest["radius"], "µm", f"radius of {what}")
    try:
        found = make(**rest)
    except TypeError:
        if not set(rest) - set(inspect.signature(make).parameters) and (wanted := missing(make, rest)):
            raise InputError(f"{what} has no {wanted[0]}; allowed: name, {allowed}") from None
        raise InputError(f"{what} has {', '.join(rest) or 'no parameters'}; allowed: name, {allowed}") from None
    if "name" not in given:
        return found
    name = given["name"]
    if not isinstance(name, str) or not name.isidentifier():
        raise InputError(f"{what} has the name {name!r}; allowed: letters, digits and _")
    return OfScene(lambda scene: found.made(scene).called(name)) if isinstance(found, OfScene) else _called(found, name)


def _called(found: Any, name: str) -> Any:
    return found.called(name) if isinstance(found, Observable) else found


def own_function(given: Mapping[str, Any], what: str, folder: Path) -> Callable[..., Any]:
    """What makes the observable that `function` in `file` is: one of `ot.observable`, or an end of `ot.end`.

    An end is a probability with `until`, and a time without.

    Args:
        given: `file`, `function`.
        what: Whose they are, for messages.
        folder: From which `file` is seen.

    Raises:
        InputError: No such file or function, or code that fails.
    """
    file, name = given.get("file"), given.get("function")
    if not isinstance(file, str) or not isinstance(name, str) or "kind" in given:
        raise InputError(f"{what} has {', '.join(sorted(given))}; allowed: kind, or file and function as texts")
    module = _module((folder / file).resolve(), what)
    found = getattr(module, name, None)
    if found is None:
        known = [
            n for n, v in vars(module).items() if isinstance(v, End | Observable) or hasattr(v, "makes_observable")
        ]
        raise InputError(f"{what}: {file} has no {name}; allowed: {', '.join(known) or 'a function, which it has not'}")
    if isinstance(found, End):
        return _of_end(found)
    if not hasattr(found, "makes_observable"):
        raise InputError(f"{what}: {name} of {file} is {type(found).__name__}; allowed: @ot.observable(…) or @ot.end")
    return found


def _of_end(found: End) -> Callable[..., Observable]:
    def made(until: Any = None, **values: Any) -> Observable:
        """A probability by `until`, or a time."""
        end = found(**values)
        if until is None:
            return Observable(f"time_to_{end.name}", "time", end=end)
        return Observable(
            end.name, "probability", end=end, until=quantity(until, "s", "until") if isinstance(until, str) else until
        )

    return made


def _module(file: Path, what: str) -> ModuleType:
    """The module of a file, loaded once; it is found under a name of its own, so that others may be called the same.

    Raises:
        InputError: It is not there, or fails.
    """
    name = f"otwarp_own_{hashlib.sha256(str(file).encode()).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    if not file.is_file() or file.suffix != ".py":
        raise InputError(f"{what}: file is {file}; allowed: a Python file that is there")
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise InputError(f"{what}: {file} fails: {type(error).__name__}: {error}") from None
    return module
