"""Values of attributes: from the authored SI units to the internal ones and back, and out of the allowed range.

Plain Python: neither USD nor NumPy. A vector is any sequence of three numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal
from typing import Any

from otwarp.errors import InputError
from otwarp.scene.vocabulary.attribute import Attribute
from otwarp.units import FROM_SI

SMALLEST, LARGEST = 1e-60, 1e60
"""Sizes of authored numbers but 0 and inf: products and quotients of several must neither overflow nor vanish."""

_EXPONENT = {dimension: round(math.log10(factor)) for dimension, factor in FROM_SI.items()}


def _shift(value: float, exponent: int) -> float:
    """`value`·10^exponent rounded once from its decimal form: 1.064e-06 m is exactly 1.064 µm."""
    if exponent == 0 or not math.isfinite(value):
        return value
    return float(Decimal(repr(value)).scaleb(exponent))


def internal(value: float, dimension: str) -> float:
    """`value`, given in the SI unit of `dimension`, in internal units (correctly rounded)."""
    return _shift(float(value), _EXPONENT[dimension])


def authored(value: float, dimension: str) -> float:
    """`value`, given in the internal unit of `dimension`, in SI units (correctly rounded)."""
    return _shift(float(value), -_EXPONENT[dimension])


def _mobility(values: Sequence[float], sign: int) -> tuple[float, ...]:
    """36 geometric mobilities between 1/m, 1/m², 1/m³ and 1/µm, 1/µm², 1/µm³: sign −1 from SI, +1 to SI."""
    exponents = [6 * sign * (1 + (i >= 3) + (j >= 3)) for i in range(6) for j in range(6)]
    return tuple(_shift(float(v), e) for v, e in zip(values, exponents, strict=True))


def to_field(attribute: Attribute, value: Any) -> Any:
    """What the description holds for an authored value: internal units, plain types, None where it stands for none."""
    if attribute.none is not None and value == attribute.none:
        return None
    if attribute.usd_type == "double":
        return internal(value, attribute.dimension)
    if attribute.vector:
        return tuple(internal(component, attribute.dimension) for component in value)
    if attribute.usd_type == "double[]":
        return _mobility(value, -1) if len(value) else None
    if attribute.usd_type == "asset":
        return getattr(value, "path", value)
    return bool(value) if attribute.usd_type == "bool" else value


def from_field(attribute: Attribute, value: Any) -> Any:
    """The value to author for what the description holds; the inverse of `to_field`."""
    if attribute.usd_type == "double[]":
        return _mobility(value, 1) if value else ()
    value = attribute.none if value is None else value
    if attribute.usd_type == "double":
        return authored(value, attribute.dimension)
    return tuple(authored(component, attribute.dimension) for component in value) if attribute.vector else value


def bad(file: str, prim: object, name: str, value: object, allowed: str) -> InputError:
    """The one-line error that names file, prim, attribute, value and what is allowed."""
    text = f"{file}: {prim}: {name} = {value}: must be {allowed}"
    return InputError(" ".join(text.split()))


def check(file: str, prim: object, name: str, attribute: Attribute, value: Any) -> None:
    """Refuse a value, in USD units, that the attribute does not allow.

    Raises:
        InputError: One line.
    """
    if not attribute.allows(value):
        raise bad(file, prim, name, value, attribute.allowed_text())
    several = attribute.vector or attribute.usd_type == "double[]"
    numbers = value if several else (value,) if attribute.usd_type == "double" else ()
    if any(n != 0.0 and math.isfinite(n) and not SMALLEST <= abs(n) <= LARGEST for n in numbers):
        sizes = f"of a size from {SMALLEST:g} to {LARGEST:g} where it is neither 0 nor inf"
        raise bad(file, prim, name, value, f"{attribute.allowed_text()}, {sizes}")
