"""The table of a study as people read it: a column for each thing that was asked, with its interval in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from otwarp.studies.results import choices_of

Row = Mapping[str, Any]
Column = tuple[str, Callable[[Row], str]]
"""A heading, and what stands below it in each row of results."""

NOTHING = "–"
"""Where nothing is known."""


def columns(asked: Mapping[str, Any], found: Any) -> list[Column]:
    """Columns of a study's results: where a point is, what was found there, and from how many trials.

    Args:
        asked: What the store says of the study.
        found: Its table.
    """
    over = found["largest" if "largest" in found else "trials"].dims
    known = [str(n) for d in over for n in found.coords if found[n].dims == (d,)]
    coordinates = [(heading(found, n), plain(n)) for n in known]
    if "largest" in found:
        return [*coordinates, (heading(found, "largest"), _interval("largest"))]
    counts = [("faults", plain("faults"))] if int(found["faults"].sum()) else []
    if asked.get("kind") == "escape":
        ratio = [("rate, step over half", _error("step_ratio"))] if "step_ratio" in found else []
        return [*coordinates, ("escape_time [s]", _interval("escape_time")), *ratio, *counts]
    by_end = next((choices_of(dict(asked), o) for o in asked["observables"] if _of_ends(o)), ())
    asked_for: list[Column] = []
    for o in asked["observables"]:
        name = o["name"]
        if o["kind"] == "probability":
            asked_for.append((name, _interval(name)))
        elif o["kind"] == "time":
            asked_for += [
                (f"{name}_rate [1/s]", _rate(name)),
                (f"{name}_median [s]", plain(f"{name}_median")),
            ]
        elif o["kind"] == "choice":
            asked_for.append((f"{name} [%]", _shares(name, choices_of(dict(asked), o))))
        else:
            asked_for.append((heading(found, name), _means(name, by_end) if by_end else _error(name)))
    return [*coordinates, *asked_for, ("trials", plain("trials")), *counts]


def _of_ends(o: Mapping[str, Any]) -> bool:
    """Whether an observable says which end came."""
    return o["kind"] == "choice" and not o["choices"]


def heading(found: Any, name: str) -> str:
    """A name with its unit.

    Args:
        found: The table that knows it.
        name: In the table.
    """
    unit = found[name].attrs.get("units")
    return f"{name} [{unit}]" if unit else name


def _number(value: Any, digits: int = 4) -> str:
    if value != value:
        return NOTHING
    if not isinstance(value, float):
        return str(value)
    # digits before the point are all said: 1700, not 1.7e+03
    return f"{value:.0f}" if 10.0**digits <= abs(value) < 1e5 else f"{value:.{digits}g}"


def plain(name: str) -> Callable[[Row], str]:
    """The number or word of that `name`, as it is."""
    return lambda row: _number(row[name])


def _interval(name: str) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        value, low, high = (row[f"{name}{end}"] for end in ("", "_low", "_high"))
        return NOTHING if value != value else f"{_number(value)} ({_number(low, 3)} – {_number(high, 3)})"

    return text


def _rate(name: str) -> Callable[[Row], str]:
    """A rate; where nothing was seen, its bound."""
    whole = _interval(f"{name}_rate")

    def text(row: Row) -> str:
        bound = row[f"{name}_rate_high"]
        return f"< {_number(bound, 3)}" if row[f"{name}_events"] == 0 and bound == bound else whole(row)

    return text


def _error(name: str) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        value, error = row[name], row[f"{name}_error"]
        return NOTHING if value != value else f"{_number(value)} ± {_number(error, 2)}"

    return text


def _shares(name: str, choices: tuple[str, ...]) -> Callable[[Row], str]:
    """What came, the most frequent first."""

    def text(row: Row) -> str:
        came = sorted(((row[f"{name}_{c}"], c) for c in choices if row[f"{name}_{c}"] > 0.0), key=lambda pair: -pair[0])
        return ", ".join(f"{c} {_number(100.0 * share, 3)}" for share, c in came) or NOTHING

    return text


def _means(name: str, ends: tuple[str, ...]) -> Callable[[Row], str]:
    """Means of a number over the trials that each end came to: a mean over all would be where no trial ended."""

    def text(row: Row) -> str:
        known = [(end, row[f"{name}_{end}"]) for end in ends]
        return ", ".join(f"{end} {_number(mean, 3)}" for end, mean in known if mean == mean) or NOTHING

    return text
