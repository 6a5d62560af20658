"""What one attribute and one schema of the vocabulary say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

INF = float("inf")


@dataclass(frozen=True, kw_only=True)
class Attribute:
    """One attribute of a schema.

    Attributes:
        name: Full USD name; a multiple-apply name holds `__INSTANCE_NAME__`.
        field: Field of the dataclass in `otwarp.scene.description` that it fills.
        usd_type: USD value type name (`double`, `int`, `token`, `bool`, `double[]`, `rel`).
        dimension: Key of `otwarp.units.FROM_SI`.
        default: Value in USD units when not authored.
        low, high: Allowed closed range in USD units; `low_open`/`high_open` exclude the end point.
        infinite: Whether +inf is allowed (numbers are finite otherwise).
        zero: Whether 0 is allowed below the range, where it stands for none.
        allowed: Tokens allowed.
        sampled: Whether time samples are allowed.
        doc: One sentence.
    """

    name: str
    field: str
    usd_type: str = "double"
    dimension: str = "none"
    default: Any = None
    low: float = -INF
    high: float = INF
    low_open: bool = False
    high_open: bool = False
    infinite: bool = False
    zero: bool = False
    allowed: tuple[str, ...] = ()
    sampled: bool = False
    doc: str

    @property
    def number(self) -> bool:
        """Whether its value is one number, in a range."""
        return self.usd_type in ("double", "int")

    def range_text(self) -> str:
        """The allowed range, as error messages and documentation print it."""
        if self.allowed:
            return "one of " + ", ".join(self.allowed)
        if self.usd_type in ("bool", "rel", "double[]"):
            return {"bool": "true or false", "rel": "a prim path", "double[]": "36 finite numbers or none"}[
                self.usd_type
            ]
        left = "(" if self.low_open or self.low == -INF else "["
        right = ")" if self.high_open or (self.high == INF and not self.infinite) else "]"
        return f"{'0 or ' if self.zero else ''}{left}{self.low:g}, {self.high:g}{right}"


@dataclass(frozen=True, kw_only=True)
class Schema:
    """One applied API schema: its name, whether it is multiple-apply, what it may be applied to, its attributes."""

    name: str
    multiple: bool = False
    instances: tuple[str, ...] = ()
    applies_to: str
    doc: str
    attributes: tuple[Attribute, ...]
