"""What an inlet goes with: a domain that ends somewhere, in which the inlet lies, and cells that use it."""

from __future__ import annotations

from collections.abc import Sequence

from otwarp.scene.description import Body, Settings
from otwarp.scene.vocabulary.values import authored, bad

_AXES = "xyz"


def check_inlet(where: str, root: str, settings: Settings, bodies: Sequence[Body]) -> None:
    """Refuse a domain or an inlet that is inside out, an inlet that is nowhere, and ends along periodic axes.

    Args:
        where: What errors name first.
        root: Path of the default prim.

    Raises:
        InputError: One line.
    """

    def refuse(name: str, axis: int, allowed: str) -> Exception:
        """The error that one of the four corners is not what it may be along an axis."""
        values = [f"{authored(v, 'length'):g}" for v in getattr(settings, name)]
        side, corner = name.split("_")
        said = f"({', '.join(values)})"
        return bad(where, root, f"ot:scene:{side}{corner.title()}", said, f"{allowed} along {_AXES[axis]}")

    def metres(micrometres: float) -> str:
        return f"{authored(micrometres, 'length'):g}"

    ends = [low != high for low, high in zip(settings.domain_low, settings.domain_high, strict=True)]
    for axis in range(3):
        domain = settings.domain_low[axis], settings.domain_high[axis]
        inlet = settings.inlet_low[axis], settings.inlet_high[axis]
        for name, (low, high) in (("domain", domain), ("inlet", inlet)):
            if high < low:
                raise refuse(f"{name}_high", axis, f"at least {metres(low)} m, ot:scene:{name}Low,")
        if any(inlet) and not any(ends):
            raise refuse("inlet_high", axis, "0 m without ot:scene:domainLow and domainHigh, as the inlet is")
        if ends[axis] and settings.period[axis] > 0.0:
            raise refuse("domain_high", axis, f"{metres(domain[0])} m, ot:scene:domainLow: no end, as space repeats,")
        if ends[axis] and not domain[0] <= inlet[0] <= inlet[1] <= domain[1]:
            outside = "inlet_low" if not domain[0] <= inlet[0] <= domain[1] else "inlet_high"
            raise refuse(outside, axis, f"in the domain, [{metres(domain[0])}, {metres(domain[1])}] m")
        reach = max(abs(end - settings.period_center[axis]) for end in inlet)
        if any(ends) and 0.0 < settings.period[axis] < 2.0 * reach:
            raise refuse("inlet_high", axis, "in the cell that repeats, as ot:scene:inletLow,")
    if any(ends) and not any(body.kind == "cell" for body in bodies):
        axis = ends.index(True)
        raise refuse("domain_high", axis, "as ot:scene:domainLow in a scene without cells, which alone come in again,")
