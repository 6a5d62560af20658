"""Order parameters: numbers that say how far a world has come on its way to an escape."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import warp as wp

from otwarp.errors import InputError
from otwarp.kernels.core.functions import digest_of
from otwarp.kernels.drivers.episodes import WorldFunction
from otwarp.laws.trap_law import MODELS
from otwarp.scene import Scene
from otwarp.scene.read.variations import nearest
from otwarp.studies.functions import world_function


@dataclass(frozen=True, eq=False)
class Order:
    """An order parameter.

    Attributes:
        name: In tables; without a function the order parameter of held spheres, `distance` or `energy`.
        function: How it is read; None for one of held spheres.
        values: Parameters of the function, by name, in their order.
        unit: Of the number.
        measured: Whether it needs trap forces, which are evaluated only where somebody asks.
        trap: Path of the trap whose sphere counts; None: the largest of all.
    """

    name: str
    function: WorldFunction | None = None
    values: tuple[float, ...] = ()
    unit: str = ""
    measured: bool = False
    trap: str | None = None

    def values_in(self, scene: Scene) -> Sequence[float]:
        """Numbers that its function reads in a scene.

        Raises:
            InputError: The scene has no trap of that name, it holds nothing, or its force has no potential.
        """
        if self.function is not None:
            return self.values
        held = [t.prim for t in scene.traps if t.holds]
        if self.trap is not None and self.trap not in held:
            raise InputError(f"order {self.name}: {self.trap} is none of the traps that hold a sphere: "
                             f"{', '.join(held) or 'there are none'}{nearest(self.trap, held)}")  # fmt: skip
        pushed = [t for t in scene.traps if self.trap in (None, t.prim) and t.model not in MODELS]
        if self.name == "energy" and pushed:
            raise InputError(
                f"order energy: the force of {pushed[0].prim}, whose ot:trap:model is {pushed[0].model}, is not "
                f"conservative; allowed: traps with {' or '.join(MODELS)}, or order distance"
            )
        only = -1 if self.trap is None else [t.prim for t in scene.traps].index(self.trap)
        return (only, *self.values, 0.0)

    def described(self) -> dict[str, Any]:
        """What a store says of it."""
        said: dict[str, Any] = {"name": self.name, "unit": self.unit, "parameters": list(self.values)}
        if self.function is None:
            return said | {"trap": self.trap}
        return said | {"sha256": digest_of(self.function.function, self.name, self.function.kinds)}


def distance(trap: str | None = None, *, relative: bool = False) -> Order:
    """How far a held sphere is from the equilibrium point of its trap [µm], the farthest where several are held.

    Args:
        trap: Path of the one trap that counts.
        relative: Whether in units of the distance at which the sphere has escaped, for traps of unequal reach.
    """
    return Order("distance", values=(float(relative),), unit="" if relative else "µm", trap=trap)


def energy(trap: str | None = None) -> Order:
    """Potential energy of a held sphere in its trap [k_BT], the largest where several are held; 0 at the equilibrium.

    Where curves differ across and along the beam, surfaces of equal energy are closer to those of equal chance than
    spheres are. Forces of tables and exact ones have no potential, and are refused when the study is made.

    Args:
        trap: Path of the one trap that counts.
    """
    return Order("energy", unit="k_BT", trap=trap)


def order(*, unit: str = "", measured: bool = False) -> Callable[[Callable[..., Any]], Callable[..., Order]]:
    """Make an order parameter of a function: a number that grows on the way to an escape.

    The function is Warp code `(now: otwarp.WorldNow, *parameters) -> float`; parameters are annotated as `float`, `int`
    or `wp.vec3` and are given when it is used, or have defaults. Which function it is decides how long an estimate
    takes, not what it tends to.

    Args:
        unit: Of the number.
        measured: Whether it reads forces or distances of traps.

    Raises:
        InputError: The function is no such function.

    Example:
        >>> @ot.order(unit="µm")
        ... def height(now: ot.WorldNow, body: int = 0) -> float:
        ...     return now.state.position[now.world, body][2]
    """

    def made(function: Callable[..., Any]) -> Callable[..., Order]:
        """What makes order parameters of the function, for the values of its parameters."""
        read, row = world_function("order", function)

        def given(**values: Any) -> Order:
            """The order parameter with these values; replaced by the function's own text."""
            return Order(function.__name__, read, row(values), unit, measured)

        given.__name__, given.__doc__ = function.__name__, function.__doc__
        return given

    return made


def order_of(given: Any) -> Order:
    """An order parameter from what a user gives: one, or what makes one without arguments.

    Raises:
        InputError: Anything else.
    """
    found = given() if callable(given) and not isinstance(given, Order | wp.Function) else given
    if not isinstance(found, Order):
        raise InputError(
            f"order is {given!r}; allowed: ot.distance(), ot.energy(), or a function decorated with ot.order()"
        )
    return found
