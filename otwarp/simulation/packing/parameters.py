"""Parameters that may differ from world to world, and how a user's numbers become `(1|W, n)` arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from otwarp.errors import InputError
from otwarp.scene import Scene, vocabulary
from otwarp.scene.check.numbers import FARTHEST
from otwarp.scene.vocabulary import Attribute, Schema
from otwarp.scene.vocabulary.values import internal, to_field
from otwarp.simulation.packing.arguments import by_name, numbers
from otwarp.units import INTERNAL_SYMBOL

Of = Literal["", "traps", "bodies"]


@dataclass(frozen=True)
class Parameter:
    """A parameter of the medium or the flow (one number per world), of the traps or of the bodies.

    Attributes:
        of: What it has one value for, besides the world: each trap, each body, or nothing more.
        width: Components of one value.
        low, high: Least and greatest allowed value; `strict` excludes the least.
        infinite: Whether inf is a value: no limit.
        unit: Internal unit, for messages and help.
        longest: Greatest length of a vector, in its internal unit.
        whole: Whether values are whole numbers.
    """

    of: Of = ""
    width: int = 1
    low: float = -np.inf
    high: float = np.inf
    strict: bool = False
    infinite: bool = False
    unit: str = ""
    longest: float = np.inf
    whole: bool = False

    @property
    def allowed(self) -> str:
        """What it allows, as messages say it."""
        kind = "whole numbers " if self.whole else ""
        if np.isfinite(self.high):
            return f"{kind}in {'(' if self.strict else '['}{self.low:g}, {self.high:g}] {self.unit}".rstrip()
        bound = f"{'>' if self.strict else '≥'} {self.low:g}" if np.isfinite(self.low) else "finite"
        return f"{kind}{bound}{'' if self.infinite or bound == 'finite' else ', finite'} {self.unit}".rstrip()


def _parameter(schema: Schema, row: Attribute) -> Parameter:
    of: Of = schema.of if schema.of in ("traps", "bodies") else ""
    return Parameter(
        of,
        width=3 if row.vector else 1,
        low=-np.inf if row.vector else internal(row.interval.low, row.dimension),
        high=np.inf if row.vector else internal(row.interval.high, row.dimension),
        strict=row.interval.low_open and np.isfinite(row.interval.low),
        infinite=row.interval.infinite,
        unit=row.per_world_unit or INTERNAL_SYMBOL[row.dimension],
        longest=internal(row.interval.high, row.dimension) if row.vector else np.inf,
    )


def _of_vocabulary(*schemas: Schema) -> dict[str, Parameter]:
    """The parameters that the rows of schemas name: all their first names, then all their second ones."""
    rows = [(schema, row) for schema in schemas for row in schema.attributes]
    return {
        row.per_world[place]: _parameter(schema, row)
        for place in range(2)
        for schema, row in rows
        if place < len(row.per_world)
    }


PARAMETERS: dict[str, Parameter] = {
    **_of_vocabulary(vocabulary.SCENE, vocabulary.FLOW),
    "trap_position": Parameter(
        "traps", width=3, unit="µm", longest=FARTHEST
    ),  # a transform of the prim, not an attribute
    **_of_vocabulary(vocabulary.TRAP, vocabulary.TRAP_LAW),
    **_of_vocabulary(vocabulary.BODY, vocabulary.CELL),
}
"""Everything that `Simulation(..., parameters={name: values})` accepts: what the scene vocabulary says is per world."""


@dataclass(frozen=True, eq=False)
class SharedRows:
    """Parameters of worlds of which many have the same: what a `Simulation` takes instead of a row for each world.

    Attributes:
        values: Name → values as `Simulation(..., parameters=…)` takes them, of R rows instead of W worlds.
        rows: R.
        which: (W) int32 row that each of all worlds has; None: its own.
    """

    values: Mapping[str, ArrayLike]
    rows: int
    which: np.ndarray | None

    @classmethod
    def own(cls, parameters: Mapping[str, ArrayLike] | None, worlds: int) -> SharedRows:
        """Of parameters that have a row for each world, or one for all; None: no parameters.

        Raises:
            InputError: They are no mapping.
        """
        return cls({} if parameters is None else by_name("parameters", parameters), worlds, None)

    def check(self, worlds: int) -> None:
        """Refuse worlds without a row.

        Raises:
            InputError: Other worlds than there are, or another row.
        """
        if self.which is None:
            return
        inside = self.which.dtype.kind in "iu" and np.all((self.which >= 0) & (self.which < self.rows))
        if self.which.shape != (worlds,) or not inside:
            raise InputError(f"shared rows have which of shape {self.which.shape}; allowed: ({worlds},) whole numbers, "
                             f"0 to {self.rows - 1}")  # fmt: skip


def expand(
    name: str, values: ArrayLike, *, worlds: int, traps: int, bodies: int = 0, spec: Parameter | None = None
) -> np.ndarray:
    """Return `values` as a float64 array of shape (1|W,), (1|W, n) or (1|W, n, 3), n traps or bodies.

    A scalar serves all worlds and traps (or bodies); (n,) serves all worlds; (W, 1) or (W,) (medium and flow) all n.

    Raises:
        InputError: Unknown name, wrong shape, a value that is not finite or out of range.
    """
    if spec is None and name not in PARAMETERS:
        raise InputError(f"parameter {name!r} is unknown; allowed: {', '.join(PARAMETERS)}")
    spec = spec or PARAMETERS[name]
    array = numbers(f"parameter {name}", values)
    tail = (3,) if spec.width == 3 else ()
    lead = array.shape[: array.ndim - len(tail)]
    good_tail = array.shape[array.ndim - len(tail) :] == tail
    count = bodies if spec.of == "bodies" else traps
    if not spec.of:
        good, shape = lead in ((), (1,), (worlds,)), (*(lead or (1,)),)
    else:
        good = len(lead) <= 2 and all(n in (1, full) for n, full in zip(lead[::-1], (count, worlds), strict=False))
        shape = (lead[0] if len(lead) == 2 else 1, count)
    if not (good and good_tail):
        wanted = f"scalar, ({spec.of},), (worlds, 1) or (worlds, {spec.of})" if spec.of else "scalar or (worlds,)"
        raise InputError(
            f"parameter {name} has shape {array.shape}; allowed: {wanted}{' followed by 3' if tail else ''} "
            f"with worlds = {worlds}{f', {spec.of} = {count}' if spec.of else ''}"
        )
    check_range(name, spec, array)
    return np.ascontiguousarray(np.broadcast_to(array.reshape(array.shape or (1,)), (*shape, *tail)))


def check_range(name: str, spec: Parameter, array: np.ndarray) -> None:
    """Refuse numbers that a parameter does not allow.

    Raises:
        InputError: One is not finite or out of range.
    """
    outside = (array <= spec.low) if spec.strict else (array < spec.low)
    outside |= np.isnan(array) | (array > spec.high) | (np.isinf(array) & (not spec.infinite))
    if spec.whole:
        outside |= array != np.floor(array)
    if np.any(outside):
        raise InputError(f"parameter {name} has the value {array[outside].ravel()[0]:g}; allowed: {spec.allowed}")
    if not np.isfinite(spec.longest):
        return
    with np.errstate(over="ignore"):
        length = np.linalg.norm(array, axis=-1).max(initial=0.0)
    if length > spec.longest:
        limit = f"≤ {spec.longest:g} {spec.unit}"
        raise InputError(f"parameter {name} has a vector of length {length:g}; allowed: {limit}")


def expand_all(
    parameters: Mapping[str, ArrayLike],
    *,
    worlds: int,
    traps: int,
    bodies: int = 0,
    more: Mapping[str, Parameter] | None = None,
) -> dict[str, np.ndarray]:
    """Every user parameter as a `(1|W, …)` array; see `expand`. `more` are those of the user's forces."""
    known = PARAMETERS | dict(more or {})
    for name in parameters:
        if name not in known:
            raise InputError(f"parameter {name!r} is unknown; allowed: {', '.join(known)}")
    size = {"worlds": worlds, "traps": traps, "bodies": bodies}
    return {n: expand(n, values, spec=known[n], **size) for n, values in parameters.items()}


def scene_values(scene: Scene) -> dict[str, np.ndarray]:
    """The parameters of medium, flow and bodies as the scene authors them, one row; those of traps move in time.

    Returns:
        Name → (1,) of the medium and the flow, (1, B) or (1, B, 3) of the bodies, in internal units.
    """
    values: dict[str, np.ndarray] = {}
    for schema in (vocabulary.SCENE, vocabulary.FLOW, vocabulary.BODY):
        owners = {"": [scene], "flow": [scene.flow], "bodies": scene.bodies}[schema.of]
        for row in schema.attributes:
            for name in row.per_world:
                array = np.array([_field(owner, row) for owner in owners], dtype=float)
                values[name] = array[None] if schema.of == "bodies" else array
    return values


def values_of(values: Mapping[str, np.ndarray], b: int) -> dict[str, np.ndarray]:
    """Of `values`, those of one body as (1|W,) or (1|W, 3), and all that are not of bodies as they are."""
    bodies = {name for name, spec in PARAMETERS.items() if spec.of == "bodies"}
    return {name: array[:, b] if name in bodies else array for name, array in values.items()}


def _field(owner: object, row: Attribute) -> object:
    """What a part of the scene holds for an attribute, its default where there is no such part or no such entry."""
    for name in row.field.split("."):
        owner = owner.get(name) if isinstance(owner, Mapping) else getattr(owner, name, None)
    return to_field(row, row.default) if owner is None else owner
