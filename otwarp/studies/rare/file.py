"""Studies of escapes in TOML: a table [escape] in the place of observables and stop.

[escape]
order = "distance"                      # or "energy", or { name = "energy", trap = "/World/trap" }
method = "forward-flux"                 # or "splitting"
runs = 16
branches = 1000
interfaces = ["0.2 µm", "0.3 µm"]       # else they are placed by pilot runs
"""

from __future__ import annotations

from typing import Any

from otwarp.errors import InputError
from otwarp.studies.quantity import quantity
from otwarp.studies.rare.orders import Order, distance, energy

KEYS = ("order", "interfaces", "basin", "method", "runs", "branches", "crossing", "relax", "every", "halved", "level")
"""What the table may say."""

NOT_BESIDE = ("observable", "stop", "scatter", "every")
"""What a study file says of other studies alone."""


def escape_arguments(common: dict[str, Any], said: dict[str, Any], table: dict[str, Any]) -> dict[str, Any]:
    """Arguments of `EscapeStudy`.

    Args:
        common: What the file says of any study.
        said: The whole file.
        table: Its [escape].

    Raises:
        InputError: Anything that is not allowed.
    """
    beside = [key for key in NOT_BESIDE if key in said]
    if beside:
        raise InputError(f"{beside[0]} stands beside escape; allowed: escape alone, with {', '.join(KEYS)}")
    unknown = [key for key in table if key not in KEYS]
    if unknown:
        raise InputError(f"escape has {unknown[0]}; allowed: {', '.join(KEYS)}")
    found = {key: value for key, value in common.items() if key not in ("observables", "scatter")} | table
    found["order"] = order = _order(table.get("order", "distance"))
    if "interfaces" in table:
        if not isinstance(table["interfaces"], list):
            raise InputError(f"interfaces is {table['interfaces']!r}; allowed: a list")
        found["interfaces"] = [quantity(v, order.unit, f"interface {n + 1}") for n, v in enumerate(table["interfaces"])]
    if "basin" in table:
        found["basin"] = quantity(table["basin"], order.unit, "basin")
    if "relax" in table:
        found["relax"] = quantity(table["relax"], "s", "relax")
    return found


def _order(given: Any) -> Order:
    """`distance`, `energy`, or a table with the name of one and its arguments."""
    rest = {"name": given} if isinstance(given, str) else dict(given) if isinstance(given, dict) else {"name": None}
    make, allowed = NAMED.get(rest.pop("name", "distance"), (None, ()))
    if make is None or set(rest) - set(allowed):
        raise InputError(f"order is {given!r}; allowed: {', '.join(NAMED)}, or a table with name, trap, and for a "
                         "distance relative; one's own function in Python")  # fmt: skip
    return make(**rest)


NAMED: dict[Any, tuple[Any, tuple[str, ...]]] = {
    "distance": (distance, ("trap", "relative")),
    "energy": (energy, ("trap",)),
}
"""Order parameters that a file names, and their arguments."""
