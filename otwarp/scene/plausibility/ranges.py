"""Numbers outside what the field uses, and the unit that was probably meant.

The ranges are wide: from nanoparticles to aggregates, from hot water to syrups, from the softest cell to diamond. A
number outside them is allowed, and most often a slip of units by a factor of a thousand or a million.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from otwarp.scene.description import Body, Trap
from otwarp.scene.finding import Finding
from otwarp.scene.flow_profile import kinds_with
from otwarp.scene.scene import Scene
from otwarp.units import FROM_SI, INTERNAL_SYMBOL, SI_SYMBOL

Values = Callable[[Scene], Iterator[tuple[str, str, float]]]
"""Gives prim, name and value in internal units of every number of one kind."""

SLIPS: dict[str, tuple[tuple[str, float], ...]] = {
    "length": (("µm", 1e-6), ("nm", 1e-9), ("mm", 1e-3)),
    "speed": (("µm/s", 1e-6), ("mm/s", 1e-3)),
    "power": (("mW", 1e-3),),
    "force": (("pN", 1e-12), ("nN", 1e-9)),
    "stiffness": (("pN/µm", 1e-6), ("pN/nm", 1e-3)),
    "viscosity": (("mPa·s", 1e-3),),
    "pressure": (("kPa", 1e3), ("MPa", 1e6), ("GPa", 1e9)),
    "density": (("g/cm³", 1e3),),
    "surface_energy": (("mJ/m²", 1e-3), ("µJ/m²", 1e-6)),
}
"""Dimension → units that numbers are given in by mistake, with their factors to SI."""

GEOMETRY = (
    (1e-4, "metersPerUnit is 1e-6 where lengths are in µm, 0.01 where they are in cm"),
    (1e-6, "metersPerUnit is 1e-6 where lengths are in µm, 1 where they are in m"),
    (1e6, "lengths of geometry are in stage units, not in metres"),
)
"""Factors by which geometry is off when its unit is mistaken, and what to look at."""

WATER = 0.00089
"""Viscosity of water at 25 °C [Pa·s]."""


@dataclass(frozen=True)
class UsualRange:
    """A kind of number.

    Attributes:
        low, high: Usual values, in internal units; 0 and infinite ones are never odd.
        dimension: Key of `otwarp.units.FROM_SI`.
        values: Finds them.
        parameters: Names of the parameters of `Simulation` that are such numbers.
        geometry: Whether they are authored in stage units.
    """

    low: float
    high: float
    dimension: str
    values: Values
    parameters: tuple[str, ...] = ()
    geometry: bool = False

    def odd(self, value: float) -> bool:
        """Whether a value is neither usual nor one that stands for none."""
        return np.isfinite(value) and value != 0.0 and not self.low <= abs(value) <= self.high

    def text(self, value: float) -> str:
        """What is said of an odd value."""
        si, unit = value / FROM_SI[self.dimension], SI_SYMBOL[self.dimension]
        symbol = INTERNAL_SYMBOL[self.dimension]
        shown = f"{value:g} {symbol}" if self.geometry or unit == symbol else f"{si:g} {unit} ({value:g} {symbol})"
        return self._shown(value, shown, self._meant(value, si))

    def parameter_text(self, value: float) -> str:
        """What is said of an odd value that a program gives, in internal units."""
        symbol, unit = INTERNAL_SYMBOL[self.dimension], SI_SYMBOL[self.dimension]
        if symbol == unit:
            return self.text(value)
        right = value * FROM_SI[self.dimension]
        meant = "" if self.odd(right) else f"did you mean {right:g} {symbol}? parameters are in {symbol}, not in {unit}"
        return self._shown(value, f"{value:g} {symbol}", meant)

    def _shown(self, value: float, shown: str, meant: str) -> str:
        if self.dimension == "viscosity":
            shown += f", {value / WATER:.3g} × that of water"
        usual = f"usual: {self.low:g} … {self.high:g} {INTERNAL_SYMBOL[self.dimension]}".rstrip()
        return "; ".join(filter(None, [shown.replace(" ,", ","), usual, meant]))

    def _meant(self, value: float, si: float) -> str:
        """The question whether another unit was meant; empty if none would make the number usual."""
        if self.dimension == "temperature":
            kelvin = si + 273.15
            return f"did you mean {si:g} °C, which is {kelvin:g} K?" if si >= 1.0 and not self.odd(kelvin) else ""
        if self.geometry:
            near = [(value * factor, why) for factor, why in GEOMETRY if not self.odd(value * factor)]
            return f"did you mean {near[0][0]:g} µm? {near[0][1]}" if near else ""
        for unit, factor in SLIPS.get(self.dimension, ()):
            if not self.odd(value * factor):
                return f"did you mean {si:g} {unit}, which is {si * factor:g} {SI_SYMBOL[self.dimension]}?"
        return ""


def _scene(name: str, field: str) -> Values:
    """A number of the scene itself: `medium.viscosity`, `settings.frames_per_second`."""
    part, last = field.split(".")
    prim = (lambda scene: scene.root) if name.startswith("ot:") else lambda scene: "/"
    return lambda scene: iter([(prim(scene), name, float(getattr(getattr(scene, part), last)))])


def _one(name: str, part: str, field: str) -> Values:
    """A number of the flow, the microscope or the goal, where there is one."""

    def values(scene: Scene) -> Iterator[tuple[str, str, float]]:
        found = getattr(scene, part)
        if found is not None:
            yield found.prim, name, float(getattr(found, field))

    return values


def _trap(name: str, number: Callable[[Trap], float]) -> Values:
    return lambda scene: ((trap.prim, name, number(trap)) for trap in scene.traps)


def _law(field: str) -> Values:
    """A constant of the curves of traps that follow them."""

    def values(scene: Scene) -> Iterator[tuple[str, str, float]]:
        """Prim, name and number of each curve that is used."""
        for trap in scene.traps:
            if trap.radial is None or trap.optical or (field == "threshold" and trap.model == "harmonic"):
                continue
            for instance, law in (("radial" if trap.axial else "isotropic", trap.radial), ("axial", trap.axial)):
                if law is not None:
                    yield trap.prim, f"ot:trapLaw:{instance}:{field}", float(getattr(law, field))

    return values


def _body(name: str, number: Callable[[Body], float], when: Callable[[Scene], bool] = lambda scene: True) -> Values:
    """A number of every body; `{}` in the name is `body` or `cell`."""

    def values(scene: Scene) -> Iterator[tuple[str, str, float]]:
        if when(scene):
            for body in scene.bodies:
                yield body.name, name.format("cell" if body.kind == "cell" else "body"), float(number(body))

    return values


def _radii(scene: Scene) -> Iterator[tuple[str, str, float]]:
    for body in scene.bodies:
        for part in (*body.spheres, *body.rods):
            yield (part.prim if body.instance is None else body.name), "radius", float(part.radius)


def _flow(name: str, field: str, *kinds: str) -> Values:
    """A number of the flow, if its kind looks at it."""
    values = _one(name, "flow", field)
    return lambda scene: values(scene) if scene.flow is not None and scene.flow.kind in kinds else iter(())


def _weighs(scene: Scene) -> bool:
    return scene.settings.gravity


ROWS: tuple[UsualRange, ...] = (
    UsualRange(2e-4, 0.1, "viscosity", _scene("ot:medium:viscosity", "medium.viscosity"), ("medium_viscosity",)),
    UsualRange(
        250.0, 400.0, "temperature", _scene("ot:medium:temperature", "medium.temperature"), ("medium_temperature",)
    ),
    UsualRange(0.1, 1e5, "rate", _scene("framesPerSecond", "settings.frames_per_second")),
    UsualRange(0.01, 500.0, "length", _radii, geometry=True),
    UsualRange(1e-3, 3e3, "power", _trap("ot:trap:power", lambda t: float(t.power.values.max())), ("trap_power",)),
    UsualRange(0.3, 2.5, "length", _trap("ot:trap:wavelength", lambda t: t.wavelength)),
    UsualRange(0.01, 1e4, "speed", _trap("ot:trap:speedLimit", lambda t: t.speed_limit), ("trap_speed_limit",)),
    UsualRange(0.01, 1e3, "length", _trap("ot:trap:reach", lambda t: t.reach)),
    UsualRange(1e-4, 1e4, "stiffness", _law("stiffness")),
    UsualRange(1e-3, 1e3, "length", _law("threshold"), ("trap_threshold", "trap_axial_threshold")),
    UsualRange(1e-2, 1e3, "length", _law("cutoff"), ("trap_cutoff", "trap_axial_cutoff")),
    UsualRange(1e-2, 1e3, "length", _law("radius")),
    UsualRange(10.0, 2e12, "pressure", _body("ot:{}:youngsModulus", lambda b: b.material.youngs_modulus)),
    UsualRange(0.0, 0.2e6, "surface_energy", _body("ot:{}:adhesion", lambda b: b.material.adhesion)),
    UsualRange(1e-3, 1e6, "force", _body("ot:{}:warningForce", lambda b: b.warning_force)),
    UsualRange(1e-10, 3e-8, "density", _body("ot:{}:density", lambda b: b.density, _weighs)),
    UsualRange(1e-3, 1e4, "speed", _flow("ot:flow:speed", "speed", *kinds_with(strength="speed")), ("flow_speed",)),
    UsualRange(
        1e-4,
        1e5,
        "rate",
        _flow("ot:flow:shearRate", "shear_rate", *kinds_with(strength="shear_rate")),
        ("flow_shear_rate",),
    ),
    UsualRange(0.5, 1e5, "length", _flow("ot:flow:halfHeight", "half_height", *kinds_with(length="half_height"))),
    UsualRange(0.5, 1e5, "length", _flow("ot:flow:halfWidth", "half_width", *kinds_with(length="half_width"))),
    UsualRange(1e-3, 100.0, "length", _one("ot:camera:pixelSize", "camera", "pixel_size")),
    UsualRange(1e-2, 1e4, "length", _one("ot:goal:tolerance", "goal", "tolerance")),
    UsualRange(1e-2, 1e4, "length", _one("ot:goal:lostDistance", "goal", "lost_distance")),
    UsualRange(1e-2, 1e4, "length", _one("ot:goal:cellLostDistance", "goal", "cell_lost_distance")),
    UsualRange(1e-2, 1e4, "length", _one("ot:goal:distanceWarning", "goal", "distance_warning")),
)
"""What is looked at."""


def unusual_parameters(values: Mapping[str, np.ndarray]) -> Iterator[str]:
    """One warning for each of a program's parameters, arrays in internal units, that has unusual values."""
    for row in ROWS:
        for name in row.parameters:
            found = np.abs(values.get(name, np.zeros(0)))
            found = found[np.isfinite(found) & (found > 0.0)]
            odd = [value for value in (found.min(), found.max()) if row.odd(value)] if found.size else []
            if odd:
                yield f"parameter {name} = {row.parameter_text(odd[0])}"


def unusual_numbers(scene: Scene) -> Iterator[Finding]:
    """One warning for each kind of number that is out of what is usual, at the prim where it comes first."""
    for row in ROWS:
        odd = [(prim, name, value) for prim, name, value in row.values(scene) if row.odd(value)]
        if odd:
            prim, name, value = odd[0]
            more = f" (and {len(odd) - 1} more)" if len(odd) > 1 else ""
            yield Finding(prim=prim, message=f"{name} = {row.text(value)}{more}")
