"""What one attribute and one schema of the vocabulary say."""

from __future__ import annotations

import math
import re
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import Any, Literal

from otwarp.units import SI_SYMBOL

INF = float("inf")
INSTANCE = "__INSTANCE_NAME__"
"""What stands for the instance in the attribute names of a multiple-apply schema."""

_TYPES = {bool: "bool", int: "int", float: "double", str: "token", type(None): "rel"}
_OTHER_RANGES = {
    "asset": "a file or none",
    "bool": "true or false",
    "rel": "a prim path",
    "double[]": "36 finite numbers or none",
}


@dataclass(frozen=True)
class Range:
    """An interval of numbers, written as in mathematics: "(0, 10]"; inf is a value where a square bracket holds it."""

    text: str
    low: float = field(init=False)
    high: float = field(init=False)

    def __post_init__(self) -> None:
        low, high = self.text[1:-1].split(",")
        object.__setattr__(self, "low", float(low))
        object.__setattr__(self, "high", float(high))

    def __contains__(self, value: float) -> bool:
        """Whether `value` lies in it; NaN never does."""
        above = value > self.low or (value == self.low and not self.low_open)
        return above and (value < self.high or (value == self.high and self.text[-1] == "]"))

    def __str__(self) -> str:
        return f"{self.text[0]}{self.low:g}, {self.high:g}{self.text[-1]}"

    @property
    def low_open(self) -> bool:
        """Whether the least number itself is excluded."""
        return self.text[0] == "("

    @property
    def infinite(self) -> bool:
        """Whether inf is a value."""
        return INF in self


@dataclass(frozen=True)
class Attribute:
    """One attribute of a schema.

    Attributes:
        name: Full USD name; a multiple-apply name holds `__INSTANCE_NAME__`.
        default: Value in USD units when not authored. It says the type as well: a float `double`, an int `int`, a bool
            `bool`, a text `token`, three floats `double3`, () `double[]`, None `rel`.
        dimension: Key of `otwarp.units.FROM_SI`.
        range: Allowed values in USD units; of a vector, its length.
        doc: One sentence.
        allowed: Tokens allowed.
        none: The number that stands for None in the description, allowed also outside the range.
        sampled: Whether time samples are allowed.
        optional: Whether the description leaves it out when it is not authored, and the author when it is left out.
        field: Field of the dataclass in `otwarp.scene.description` that it fills, by default the last part of the name
            in snake case. `part.field` fills a part of it: a dataclass of its own or a mapping.
        unit: Unit in USD, by default the SI unit of its dimension, "1" for a pure number, "" where none has a meaning.
        per_world: Names of the parameters of `Simulation` that give it a value per world.
        per_world_unit: Unit of those parameters, by default the internal unit of its dimension.
        usd_type: USD value type name where the default does not say it (`float3`, `asset` of a text).
    """

    name: str
    default: Any
    dimension: str = "none"
    range: str = "(-inf, inf)"
    _: KW_ONLY
    doc: str
    allowed: tuple[str, ...] = ()
    none: float | None = None
    sampled: bool = False
    optional: bool = False
    field: str = ""
    unit: str = ""
    per_world: tuple[str, ...] = ()
    per_world_unit: str = ""
    usd_type: str = ""

    def __post_init__(self) -> None:
        last = self.name.rsplit(":", 1)[-1]
        sizes = {0: "double[]", 3: "double3"}
        kind = sizes[len(self.default)] if isinstance(self.default, tuple) else _TYPES[type(self.default)]
        object.__setattr__(self, "usd_type", self.usd_type or kind)
        object.__setattr__(self, "field", self.field or re.sub("[A-Z]", lambda m: "_" + m[0].lower(), last))
        if not self.unit and (self.number or self.vector):
            object.__setattr__(self, "unit", SI_SYMBOL[self.dimension] or "1")

    @cached_property
    def interval(self) -> Range:
        """The range of allowed values, as numbers in the unit that files have."""
        return Range(self.range)

    @property
    def number(self) -> bool:
        """Whether its value is one number, in a range."""
        return self.usd_type in ("double", "int")

    @property
    def vector(self) -> bool:
        """Whether its value is three numbers."""
        return self.usd_type in ("double3", "float3")

    def allows(self, value: Any) -> bool:
        """Whether a value in USD units is one of those that it may have."""
        if self.usd_type == "double[]":
            return len(value) in (0, 36) and all(math.isfinite(v) for v in value)
        if self.vector:
            return all(math.isfinite(v) for v in value) and math.hypot(*value) in self.interval
        if self.number:
            return value in self.interval or (self.none is not None and value == self.none)
        return not self.allowed or value in self.allowed

    def range_text(self) -> str:
        """What it allows, as documentation prints it."""
        if self.allowed:
            return "one of " + ", ".join(self.allowed)
        if self.vector:
            return "3 finite numbers" + ("" if self.interval.low == -INF else f" of length in {self.interval}")
        if not self.number:
            return _OTHER_RANGES[self.usd_type]
        outside = self.none is not None and self.none not in self.interval
        return f"{f'{self.none:g} or ' if outside else ''}{self.interval}"

    def allowed_text(self) -> str:
        """What it allows, as error messages print it, with the unit."""
        text = self.range_text()
        if not (self.number or self.vector):
            return text
        if text[0] in "([":
            text = f"{'a whole number in' if self.usd_type == 'int' else 'in'} {text}"
        return text if self.unit == "1" else f"{text} {self.unit}"


@dataclass(frozen=True, kw_only=True)
class Schema:
    """One applied API schema.

    Attributes:
        name: Its USD name.
        instances: Names that its instances may have; none when it is single-apply.
        applies_to: What it may be applied to.
        doc: One sentence.
        attributes: Its attributes.
        of: Field of `Scene` that its prims fill; empty for the scene itself.
    """

    name: str
    instances: tuple[str, ...] = ()
    applies_to: str
    doc: str
    attributes: tuple[Attribute, ...]
    of: Literal["", "traps", "bodies", "obstacles", "flow", "camera", "goal"] = ""

    @property
    def multiple(self) -> bool:
        """Whether it is a multiple-apply schema."""
        return bool(self.instances)

    def __getitem__(self, field: str) -> Attribute:
        """The attribute that fills a field."""
        return next(attribute for attribute in self.attributes if attribute.field == field)
