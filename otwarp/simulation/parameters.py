"""Parameters that may differ from world to world, and how a user's numbers become `(1|W, n)` arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from otwarp.errors import InputError


@dataclass(frozen=True)
class Parameter:
    """A parameter of the medium, the flow (one number per world) or the traps (one per world and trap).

    Attributes:
        per_trap: Whether it has one value per trap.
        width: Components of one value.
        low: Least allowed value; `strict` excludes it.
        infinite: Whether inf is a value: no limit.
        unit: Internal unit, for messages and help.
    """

    per_trap: bool
    width: int = 1
    low: float = -np.inf
    strict: bool = False
    infinite: bool = False
    unit: str = ""


PARAMETERS: dict[str, Parameter] = {
    "medium_viscosity": Parameter(False, low=0.0, strict=True, unit="Pa·s"),
    "medium_temperature": Parameter(False, low=0.0, unit="K"),
    "flow_speed": Parameter(False, unit="µm/s"),
    "flow_shear_rate": Parameter(False, unit="1/s"),
    "trap_position": Parameter(True, width=3, unit="µm"),
    "trap_power": Parameter(True, low=0.0, unit="mW"),
    "trap_speed_limit": Parameter(True, low=0.0, strict=True, infinite=True, unit="µm/s"),
    "trap_stiffness": Parameter(True, low=0.0, unit="pN/µm per mW"),
    "trap_threshold": Parameter(True, low=0.0, strict=True, infinite=True, unit="µm"),
    "trap_inverse_square": Parameter(True, unit="pN·µm² per mW"),
    "trap_offset": Parameter(True, unit="pN per mW"),
    "trap_cutoff": Parameter(True, low=0.0, strict=True, infinite=True, unit="µm"),
    "trap_axial_stiffness": Parameter(True, low=0.0, unit="pN/µm per mW"),
    "trap_axial_threshold": Parameter(True, low=0.0, strict=True, infinite=True, unit="µm"),
    "trap_axial_inverse_square": Parameter(True, unit="pN·µm² per mW"),
    "trap_axial_offset": Parameter(True, unit="pN per mW"),
    "trap_axial_cutoff": Parameter(True, low=0.0, strict=True, infinite=True, unit="µm"),
}
"""Everything that `Simulation(..., parameters={name: values})` accepts."""


def expand(name: str, values: ArrayLike, *, worlds: int, traps: int) -> np.ndarray:
    """Return `values` as a float64 array of shape (1|W,), (1|W, T) or (1|W, T, 3).

    A scalar serves all worlds and traps; (T,) serves all worlds; (W, 1) or (W,) (medium and flow) all traps.

    Raises:
        InputError: Unknown name, wrong shape, a value that is not finite or out of range.
    """
    if name not in PARAMETERS:
        raise InputError(f"parameter {name!r} is unknown; allowed: {', '.join(PARAMETERS)}")
    spec = PARAMETERS[name]
    array = np.asarray(values, dtype=float)
    tail = (3,) if spec.width == 3 else ()
    lead = array.shape[: array.ndim - len(tail)]
    good_tail = array.shape[array.ndim - len(tail) :] == tail
    if not spec.per_trap:
        good, shape = lead in ((), (1,), (worlds,)), (*(lead or (1,)),)
    else:
        good = len(lead) <= 2 and all(n in (1, full) for n, full in zip(lead[::-1], (traps, worlds), strict=False))
        shape = (lead[0] if len(lead) == 2 else 1, traps)
    if not (good and good_tail):
        wanted = "scalar or (worlds,)" if not spec.per_trap else "scalar, (traps,), (worlds, 1) or (worlds, traps)"
        raise InputError(
            f"parameter {name} has shape {array.shape}; allowed: {wanted}{' followed by 3' if tail else ''} "
            f"with worlds = {worlds}, traps = {traps}"
        )
    outside = (array <= spec.low) if spec.strict else (array < spec.low)
    outside |= np.isnan(array) | (np.isinf(array) & (not spec.infinite))
    if np.any(outside):
        bound = f"{'>' if spec.strict else '≥'} {spec.low:g}" if np.isfinite(spec.low) else "finite"
        bound += "" if spec.infinite or bound == "finite" else ", finite"
        raise InputError(f"parameter {name} has the value {array[outside].ravel()[0]:g}; allowed: {bound} {spec.unit}")
    return np.ascontiguousarray(np.broadcast_to(array.reshape(array.shape or (1,)), (*shape, *tail)))


def expand_all(parameters: Mapping[str, ArrayLike], *, worlds: int, traps: int) -> dict[str, np.ndarray]:
    """Every user parameter as a `(1|W, …)` array; see `expand`."""
    return {name: expand(name, values, worlds=worlds, traps=traps) for name, values in parameters.items()}
