"""A sphere and its beam as options: of `otwarp forces`, and of the benchmarks of one bead in one trap."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli.types import POSITIVE, Number

if TYPE_CHECKING:
    from otwarp.optics.beam import Beam
    from otwarp.optics.mie import Particle


def option(*names: str, **settings: Any) -> click.Option:
    """An option whose help shows its default, if it has one."""
    return click.Option(names, show_default=settings.get("default") is not None, **settings)


def sphere_options(*, radius: float | None = None, index: str | float) -> list[click.Option]:
    """The sphere and its medium, with defaults; without one the radius is required, an index of text may be complex."""
    text = "Its refractive index" + (": 1.59, 1.5+0.01i." if isinstance(index, str) else ".")
    return [
        option(
            "--radius",
            type=POSITIVE,
            default=radius,
            required=radius is None,
            metavar="µm",
            help="Radius of the sphere.",
        ),
        option("--index", type=str if isinstance(index, str) else POSITIVE, default=index, metavar="N", help=text),
        option("--medium-index", type=POSITIVE, default=1.33, metavar="N", help="Index of the medium."),
    ]


def beam_options(*, na: float, power: float | None = None, jones: bool = False) -> list[click.Option]:
    """The beam, with defaults; its power if that can be chosen, any polarization if `jones`."""
    polarization = "x, y, 45, circular, left, or Ex,Ey." if jones else "x, y, 45, circular or left."
    chosen = (
        [option("--power", type=POSITIVE, default=power, metavar="mW", help="In the medium.")]
        if power is not None
        else []
    )
    return [
        option("--wavelength", type=POSITIVE, default=1.064, metavar="µm", help="In vacuum."),
        option("--na", type=POSITIVE, default=na, metavar="NA", help="Numerical aperture, below medium index."),
        *chosen,
        option("--beam", default="gaussian", metavar="KIND", help="gaussian, sine or aplanatic."),
        option("--polarization", default="circular", metavar="P", help=polarization),
        option(
            "--filling",
            type=Number(0.01, 100.0),
            default=1.0,
            metavar="F",
            help="1/e² radius over the aperture's radius.",
        ),
        option(
            "--charge",
            type=Number(-30, 30, whole=True),
            default=0,
            metavar="L",
            help="Azimuthal charge of a vortex, −30 to 30.",
        ),
        option(
            "--depth",
            type=Number(0.0, unit="µm"),
            default=0.0,
            metavar="µm",
            help="Of the focus below the cover glass.",
        ),
        option("--glass-index", type=POSITIVE, metavar="N", help="Index of glass and oil; default: no interface."),
    ]


@dataclass(frozen=True, kw_only=True)
class Bead:
    """A sphere and its beam, as asked for."""

    radius: float
    index: complex
    medium_index: float
    wavelength: float
    na: float
    beam: str
    polarization: str | tuple[complex, complex]
    filling: float
    charge: int
    depth: float
    glass_index: float | None

    def optics(self, power: float) -> tuple[Beam, Particle]:
        """Beam and sphere at a power [mW].

        Raises:
            InputError: What they refuse.
        """
        from otwarp.optics.beam import Beam
        from otwarp.optics.mie import Particle

        sphere = Particle(radius=self.radius, index=self.index)
        beam = Beam(
            kind=self.beam,
            numerical_aperture=self.na,
            medium_index=self.medium_index,
            wavelength=self.wavelength,
            polarization=self.polarization,
            power=power,
            filling=self.filling,
            charge=self.charge,
            depth=self.depth,
            glass_index=self.glass_index,
        )
        return beam, sphere


def taken(group: type, typed: dict[str, Any]) -> Any:
    """A dataclass such as `Bead` out of what was typed, whose options are removed from `typed`."""
    return group(**{field.name: typed.pop(field.name) for field in fields(group)})
