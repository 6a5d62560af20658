"""Rare events: rates of escapes by paths that are split on their way up, in any scene that goes on from a state.

| file | what it holds |
|---|---|
| `study`, `file` | `EscapeStudy`, open it first; the same in TOML |
| `orders` | order parameters: distance from a trap, energy in it, functions of one's own |
| `states`, `ensemble` | states on the host; worlds that go on from them until they are at an interface |
| `layout` | which worlds and numbers a run has |
| `basin`, `placement` | the flux out of the basin; where interfaces are put |
| `forward_flux`, `splitting` | the two methods |
| `compute`, `results`, `figure` | what is computed at a point; the table of it; pictures |
| `estimate` | how long a study takes |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.studies.rare.orders import Order, distance, energy, order
    from otwarp.studies.rare.study import EscapePlan, EscapeStudy

__all__ = ["EscapePlan", "EscapeStudy", "Order", "distance", "energy", "order"]

__getattr__, __dir__ = lazy_names(
    __name__, {"orders": ("Order", "distance", "energy", "order"), "study": ("EscapePlan", "EscapeStudy")}
)
