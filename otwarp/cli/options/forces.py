"""What `otwarp forces` is asked: its options by group, and the checks that the physics would make late or never."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from otwarp.cli.options.bead import Bead, beam_options, option, sphere_options, taken
from otwarp.cli.types import FILE, Number, OutputPath
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.optics.models import Ladder

SMALLEST_RADIUS, LARGEST_INDEX = 1e-4, 100.0
"""An atom's size [µm]; an index that no material has. Beyond them the recurrences and the quadrature no longer hold, or
no longer end."""


def _flag(name: str, text: str) -> click.Option:
    return click.Option([name], is_flag=True, help=text)


GROUPS: dict[str, list[click.Option]] = {
    "Sphere and medium": sphere_options(index="1.52"),
    "Beam, travelling along +z with its focus at the origin": beam_options(na=1.25, power=1.0, jones=True),
    "Forces at points": [
        option("--points", type=FILE, metavar="CSV", help="Sphere centres: columns x_um,y_um,z_um."),
        option("-o", "--out", type=OutputPath(), metavar="CSV", help="Where they go with Qx,Qy,Qz; F = Q·n·P/c."),
        click.Option(
            ["--model"], default="exact", metavar="M", help="exact (default), table, piecewise[-isotropic], harmonic."
        ),
        option("--device", metavar="NAME", help="Warp device for exact forces: cpu, cuda:0; default: NumPy."),
    ],
    "Force table": [
        _flag("--table", "Make it, or find it in the cache, and describe it."),
        option(
            "--tolerance", type=Number(1e-5, 0.1), default=1e-3, metavar="T", help="Error over peak force, 1e-5 to 0.1."
        ),
        option("--interpolation", default="bilinear", metavar="I", help="bilinear or bicubic."),
    ],
    "Curves, fits, pictures (.png, .pdf, .svg)": [
        _flag("--curves", "Print equilibrium, stiffness, escape, depth."),
        option("--plot", type=OutputPath(), metavar="FILE", help="Draw curves of all models and their errors."),
        option("--map", type=OutputPath(), metavar="FILE", help="Draw forces in the plane of the major axis."),
        option("--fit", type=click.Choice(["piecewise", "harmonic"]), help="Fit the curves; print the errors."),
        click.Option(["--continuous/--free"], default=True, help="Piecewise laws joined at δ (default) or not."),
    ],
}
"""Options as the help shows them."""


class GroupedCommand(click.Command):
    """A command whose help shows its options by group."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the groups, then what belongs to none."""
        grouped = [option for options in GROUPS.values() for option in options]
        rest = [option for option in self.get_params(ctx) if option not in grouped]
        for title, options in [*GROUPS.items(), ("Output", rest)]:
            with formatter.section(title):
                formatter.write_dl([row for option in options if (row := option.get_help_record(ctx))])


@dataclass(frozen=True, kw_only=True)
class ForcesRequest:
    """What `otwarp forces` was asked: bead, beam power [mW], points, and where the results go."""

    bead: Bead
    power: float
    points: Path | None
    out: Path | None
    model: str
    device: str | None
    table: bool
    tolerance: float
    interpolation: Literal["bilinear", "bicubic"]
    curves: bool
    plot: Path | None
    map: Path | None
    fit: str | None
    continuous: bool
    as_json: bool


def read_request(typed: dict[str, Any]) -> ForcesRequest:
    """What was typed, its numbers read.

    Raises:
        InputError: An index or a polarization that is none, or what the physics would not notice, or only late.
    """
    typed = typed | {"index": _index(typed["index"]), "polarization": _jones(typed["polarization"])}
    request = ForcesRequest(bead=taken(Bead, typed), **typed)
    _check(request)
    return request


def _check(request: ForcesRequest) -> None:
    """What the physics would not notice, or only after long work."""
    from otwarp.optics.curves import picture_format
    from otwarp.optics.models import MODELS

    if not (request.points or request.curves or request.plot or request.map or request.fit or request.table):
        raise InputError("nothing to do; allowed: --points with --out, --table, --curves, --plot, --fit, --map")
    if (request.points is None) != (request.out is None):
        raise InputError("--points and --out come together")
    if request.points and request.out and request.points.resolve() == request.out.resolve():
        raise InputError(f"--out is {request.out}, the file of --points; allowed: another file")
    if request.model not in MODELS:
        raise InputError(f"--model is {request.model!r}; allowed: {', '.join(MODELS)}")
    if 0.0 < request.bead.radius < SMALLEST_RADIUS:
        raise InputError(f"--radius is {request.bead.radius:g} µm; allowed: {SMALLEST_RADIUS:g} µm or more")
    for picture in (request.plot, request.map):
        if picture:
            picture_format(picture)


def _index(text: str) -> complex:
    try:
        value = complex(text.replace("i", "j"))
    except ValueError as error:
        raise InputError(f"--index is {text!r}; allowed: a number such as 1.59 or 1.5+0.01i") from error
    if not (value.real > 0.0 and value.imag >= 0.0 and abs(value) <= LARGEST_INDEX):
        raise InputError(f"--index is {text}; allowed: real part above 0, imaginary part 0 or more, "
                         f"and a modulus up to {LARGEST_INDEX:g}")  # fmt: skip
    return value


def _jones(text: str) -> str | tuple[complex, complex]:
    """A name, or two complex numbers separated by a comma."""
    if "," not in text:
        return text
    try:
        x, y = (complex(part.strip().replace("i", "j")) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"--polarization is {text!r}; allowed: a name or two complex numbers, as in 1,0.5i") from error
    return x, y


def make_ladder(request: ForcesRequest) -> Ladder:
    """All force models of what was typed.

    Raises:
        InputError: A value that the beam, the sphere or the table refuses.
    """
    from otwarp.optics.models import Ladder

    beam, sphere = request.bead.optics(request.power)
    if request.device is not None:
        from otwarp.device import pick_device

        pick_device(request.device)
    return Ladder(
        beam=beam,
        sphere=sphere,
        tolerance=request.tolerance,
        interpolation=request.interpolation,
        continuous=request.continuous,
        device=request.device,
    )
