"""`otwarp forces`: exact optical forces on a sphere."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from otwarp.cli.options import json_option
from otwarp.errors import InputError
from otwarp.units import BOLTZMANN

if TYPE_CHECKING:
    from otwarp.optics.beam import Beam
    from otwarp.optics.mie import Sphere


def _jones(text: str) -> str | tuple[complex, complex]:
    """A name, or two complex numbers separated by a comma."""
    if "," not in text:
        return text
    try:
        x, y = (complex(part.strip().replace("i", "j")) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"--polarization is {text!r}; allowed: a name or two complex numbers, as in 1,0.5i") from error
    return x, y


@click.command()
@click.option("--radius", type=float, required=True, help="Radius of the sphere [µm].")
@click.option(
    "--index", type=str, default="1.52", show_default=True, help="Its refractive index, as in 1.59 or 1.5+0.01i."
)
@click.option("--medium-index", type=float, default=1.33, show_default=True, help="Refractive index of the medium.")
@click.option("--wavelength", type=float, default=1.064, show_default=True, help="Vacuum wavelength [µm].")
@click.option("--na", type=float, default=1.25, show_default=True, help="Numerical aperture.")
@click.option("--beam", default="gaussian", show_default=True, help="gaussian, sine or aplanatic.")
@click.option("--polarization", default="circular", show_default=True, help="x, y, 45, circular, left, or two numbers.")
@click.option("--filling", type=float, default=1.0, show_default=True, help="1/e² radius over the aperture's radius.")
@click.option("--charge", type=int, default=0, show_default=True, help="Azimuthal charge of a vortex beam.")
@click.option("--depth", type=float, default=0.0, show_default=True, help="Depth below the cover glass [µm].")
@click.option("--glass-index", type=float, help="Index of glass and oil, for the aberration at that depth.")
@click.option("--power", type=float, default=1.0, show_default=True, help="Power in the medium [mW].")
@click.option("--model", type=click.Choice(["exact"]), default="exact", show_default=True, help="Force model.")
@click.option("--points", type=click.Path(path_type=Path), metavar="CSV", help="Sphere centres: x_um,y_um,z_um.")
@click.option("--out", type=click.Path(path_type=Path), metavar="CSV", help="Where Qx,Qy,Qz go.")
@click.option("--curves", is_flag=True, help="Print equilibrium, stiffness, escape force and trap depth.")
@click.option("--fit", type=click.Choice(["piecewise", "harmonic"]), help="Fit the curves and print the errors.")
@click.option("--plot", type=click.Path(path_type=Path), metavar="PNG", help="Draw the axial and radial curves.")
@json_option
def forces(
    radius: float,
    index: str,
    medium_index: float,
    wavelength: float,
    na: float,
    beam: str,
    polarization: str,
    filling: float,
    charge: int,
    depth: float,
    glass_index: float | None,
    power: float,
    model: str,
    points: Path | None,
    out: Path | None,
    curves: bool,
    fit: str | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Evaluate the optical force on a sphere exactly (generalised Lorenz–Mie theory).

    Forces are efficiencies Q: F = Q·n·P/c, that is 3.336·n·P[mW]·Q pN. Lengths are in µm, from the focus.
    """
    from otwarp.optics.beam import Beam
    from otwarp.optics.mie import Sphere

    if points is None and not curves and plot is None and fit is None:
        raise InputError("nothing to do; allowed: --points with --out, --curves, --fit, --plot")
    if (points is None) != (out is None):
        raise InputError("--points and --out come together")
    try:
        sphere = Sphere(radius=radius, index=complex(index.replace("i", "j")))
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"--index is {index!r}; allowed: a number such as 1.59 or 1.5+0.01i") from error
    light = Beam(
        kind=beam,
        numerical_aperture=na,
        medium_index=medium_index,
        wavelength=wavelength,
        polarization=_jones(polarization),
        power=power,
        filling=filling,
        charge=charge,
        depth=depth,
        glass_index=glass_index,
    )
    if points is not None and out is not None:
        _points(light, sphere, points, out)
    if curves or plot is not None:
        _curves(light, sphere, plot, as_json)
    if fit is not None:
        _fits(light, sphere, fit, as_json)


def _points(beam: Beam, sphere: Sphere, points: Path, out: Path) -> None:
    from otwarp.optics.exact import evaluate
    from otwarp.optics.points import read_points, write_forces

    places = read_points(points)
    result = evaluate(beam, sphere, places)
    write_forces(out, places, result.force)
    click.echo(f"wrote {out}: {len(places)} points, estimated error of Q {result.error:.1e}")


def _curves(beam: Beam, sphere: Sphere, plot: Path | None, as_json: bool) -> None:
    from otwarp.optics.analysis import trap_properties
    from otwarp.optics.curves import force_curves, plot_curves

    if plot is not None:
        result = force_curves(beam, sphere)
        plot_curves(result, plot)
        found = result.properties
    else:
        found = trap_properties(beam, sphere)
    if as_json:
        click.echo(json.dumps(dataclasses.asdict(found), indent=2))
        return
    k, f = found.stiffness, found.escape_force
    energy = BOLTZMANN * 298.15
    click.echo(f"equilibrium   z = {found.equilibrium:.5f} µm from the focus")
    click.echo(f"stiffness     {k[0]:.5g}, {k[1]:.5g}, {k[2]:.5g} pN/µm along x, y, z at {beam.power:g} mW")
    click.echo(f"escape force  {f[0]:.4g}, {f[1]:.4g} pN along x, y; {f[2]:.4g} pN downstream, {f[3]:.4g} pN upstream")
    click.echo(f"depth         {found.depth:.4g} pN·µm = {found.depth / energy:.4g} k_BT at 298.15 K")
    if found.others:
        click.echo("also stable   z = " + ", ".join(f"{z:.4f}" for z in found.others) + " µm")
    if plot is not None:
        click.echo(f"wrote {plot}")


def _fits(beam: Beam, sphere: Sphere, kind: str, as_json: bool) -> None:
    from otwarp.optics.fit import fit_harmonic, fit_piecewise

    found = fit_piecewise(beam, sphere) if kind == "piecewise" else fit_harmonic(beam, sphere)
    if as_json:
        rows = {name: dataclasses.asdict(f) for name, f in found.items()}
        for row in rows.values():
            # JSON knows no infinity: an unused distance is null
            row["law"] = {k: v if abs(v) < float("inf") else None for k, v in row["law"].items()}
        click.echo(json.dumps(rows, indent=2))
        return
    for name, f in found.items():
        w = f.law
        constants = f"K = {w.stiffness:.5g} pN/µm"
        if kind == "piecewise":
            constants += f", δ = {w.threshold:.4g} µm, A = {w.inverse_square:.5g} pN·µm², C = {w.offset:.4g} pN"
            constants += f", cut-off {w.cutoff:.4g} µm"
        click.echo(f"{name:10s}{constants}")
        errors = f"MSE {f.mse:.3e}, RMSE {f.rmse:.4g}, R² {f.r_squared:.4f}"
        click.echo(f"{'':10s}{errors} in Q; worst {f.worst:.3g} at {f.worst_at:.3g} µm")
