"""Numbers with units as people write them, `5 mW` or `0.2 µm/s`, and their way into any other unit of their kind."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from otwarp.errors import InputError

_PREFIX = {"": 0, "f": -15, "p": -12, "n": -9, "µ": -6, "μ": -6, "u": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
"""Prefix → power of ten; the micro sign stands there twice, as Unicode has it, and as keyboards do."""

_SYMBOL: dict[str, tuple[float, tuple[int, int, int, int]]] = {
    "1": (1.0, (0, 0, 0, 0)),
    "%": (0.01, (0, 0, 0, 0)),
    "rad": (1.0, (0, 0, 0, 0)),
    "deg": (math.pi / 180.0, (0, 0, 0, 0)),
    "°": (math.pi / 180.0, (0, 0, 0, 0)),
    "k_BT": (1.0, (0, 0, 0, 0)),
    "m": (1.0, (1, 0, 0, 0)),
    "g": (1e-3, (0, 1, 0, 0)),
    "s": (1.0, (0, 0, 1, 0)),
    "min": (60.0, (0, 0, 1, 0)),
    "h": (3600.0, (0, 0, 1, 0)),
    "K": (1.0, (0, 0, 0, 1)),
    "Hz": (1.0, (0, 0, -1, 0)),
    "N": (1.0, (1, 1, -2, 0)),
    "J": (1.0, (2, 1, -2, 0)),
    "W": (1.0, (2, 1, -3, 0)),
    "Pa": (1.0, (-1, 1, -2, 0)),
}
"""Symbol → factor to SI base units, and powers of metre, kilogram, second and kelvin."""

_UNPREFIXED = {"1", "%", "rad", "deg", "°", "k_BT", "min", "h"}
_EXPONENT = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_POWER = re.compile(r"^(?P<symbol>[^\d^⁰¹²³⁴⁵⁶⁷⁸⁹⁻-]+|1)(?:\^?(?P<power>-?\d+))?$")
_NUMBER = re.compile(r"^\s*(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>\S.*)?$")


@dataclass(frozen=True)
class Unit:
    """A unit: `factor` leads to SI base units, whose powers `powers` are (metre, kilogram, second, kelvin)."""

    factor: float
    powers: tuple[int, int, int, int]


def unit_of(text: str) -> Unit:
    """Read a unit such as `mW`, `pN/µm`, `Pa·s`, `1/s`, `kg/m³`, `pN/µm per mW` or nothing, for numbers without one.

    Raises:
        InputError: A symbol that is none.
    """
    factor, powers = 1.0, [0, 0, 0, 0]
    parts = re.split(r"(/|·|\*|\bper\b)", text.strip()) if text.strip() else []
    sign = 1
    for part in (p.strip() for p in parts):
        if part in ("/", "per"):
            sign = -1
        elif part in ("·", "*"):
            sign = 1
        else:
            scale, base, power = _power_of(part, text)
            factor *= scale ** (sign * power)
            powers = [p + sign * power * b for p, b in zip(powers, base, strict=True)]
    return Unit(factor, (powers[0], powers[1], powers[2], powers[3]))


def _power_of(part: str, text: str) -> tuple[float, tuple[int, int, int, int], int]:
    """Factor and powers of one symbol with its prefix, and the exponent behind it."""
    found = _POWER.match(part.translate(_EXPONENT))
    symbol, power = (found["symbol"], int(found["power"] or 1)) if found else (part, 1)
    if symbol in _SYMBOL:
        return (*_SYMBOL[symbol], power)
    prefix, base = symbol[:1], symbol[1:]
    if prefix in _PREFIX and base in _SYMBOL and base not in _UNPREFIXED:
        factor, powers = _SYMBOL[base]
        return factor * 10.0 ** _PREFIX[prefix], powers, power
    raise InputError(
        f"unit {text!r} has the symbol {part!r}; allowed: m, g, s, min, h, K, Hz, N, J, W, Pa, rad, deg, k_BT and %, "
        "with a prefix such as m, µ or n, an exponent, and · or /"
    )


def ratio(given: str, wanted: str, what: str) -> float:
    """By what numbers in the unit `given` are multiplied to be in the unit `wanted`.

    Args:
        what: Whose unit it is, for the message.

    Raises:
        InputError: No unit, or one of another kind.
    """
    try:
        there, here = unit_of(wanted), unit_of(given)
    except InputError as error:
        raise InputError(f"{what}: {error}") from None
    if here.powers != there.powers:
        has = f"has the unit {given!r}" if given.strip() else "has no unit"
        raise InputError(f"{what} {has}; allowed: {wanted or 'none'}, or another unit of the same kind")
    factor = here.factor / there.factor
    # powers of ten as they are written, so that 0.1 µm is 0.1 and no neighbour of it
    exponent = round(math.log10(factor))
    return 10.0**exponent if math.isclose(factor, 10.0**exponent, rel_tol=1e-12) else factor


def quantity(value: Any, wanted: str, what: str) -> float:
    """A number in the unit `wanted`, from a text such as `5 mW`; a number alone counts only where no unit is wanted.

    Raises:
        InputError: No number, no unit or a wrong one.
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        if wanted:
            raise InputError(f"{what} is {value:g} without a unit; allowed: a text such as '{value:g} {wanted}'")
        number, unit = float(value), ""
    else:
        found = _NUMBER.match(value) if isinstance(value, str) else None
        if found is None:
            raise InputError(
                f"{what} is {value!r}; allowed: a number{f' with its unit, as 1 {wanted}' if wanted else ''}"
            )
        number, unit = float(found["number"]), found["unit"] or ""
        if wanted and not unit:
            raise InputError(f"{what} is {value!r} without a unit; allowed: {value} {wanted}")
    if not math.isfinite(number):
        raise InputError(f"{what} is {number}; allowed: finite numbers")
    return number * ratio(unit, wanted, what)
