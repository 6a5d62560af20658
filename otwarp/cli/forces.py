"""`otwarp forces`: optical forces on a sphere, exact and by every cheaper model, each with its error."""

from __future__ import annotations

import dataclasses
import math
import os
import time
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli.options.forces import GROUPS, ForcesRequest, GroupedCommand, make_ladder, read_request
from otwarp.cli.output import json_text
from otwarp.units import BOLTZMANN

if TYPE_CHECKING:
    from otwarp.optics.models import Ladder

MOST_POINTS, SOME_POINTS = 5000, 2000
"""Points up to which a model is compared with exact on all of them, and how many are drawn from more."""

LAYERS = {
    1: "circular polarization has one helicity: the force does not depend on the azimuth",
    2: "both helicities interfere: cos 2φ, and sin 2φ around the axis, beside the constant",
    3: "both helicities and a vortex, which breaks the mirror symmetry: cos 2φ and sin 2φ in every component",
}
"""Why a table has so many layers."""


@click.command(
    cls=GroupedCommand,
    params=[
        *(option for options in GROUPS.values() for option in options),
        click.Option(["--json", "as_json"], is_flag=True, help="Print one JSON object for a program, and no text."),
    ],
    epilog="""\b
Examples:
  otwarp forces --radius 1 --index 1.59 --na 1.2 --curves --plot force.png --map map.png
  otwarp forces --radius 1 --points points.csv --out forces.csv --model table --tolerance 1e-4
  otwarp forces --radius 2.5 --fit piecewise --free --json
  otwarp forces --radius 0.5 --na 1.2 --polarization x --table --interpolation bicubic""",
)
def forces(**typed: Any) -> None:
    """Evaluate the optical force on a sphere, exactly (generalised Lorenz–Mie theory) or by a cheaper model.

    Forces are efficiencies Q: F = Q·n·P/c, that is 3.336·n·P[mW]·Q pN. Lengths are in µm, from the focus.
    """
    # exact forces are products of many small matrices, on which the threads of BLAS wait longer than they work
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    request = read_request(typed)
    ladder = make_ladder(request)
    found: dict[str, Any] = {}
    for name, wanted, act in (
        # first, so that its time is the table's and not shared with what needs it later
        ("table", request.table, _table),
        ("points", request.points, _points),
        ("curves", request.curves or request.plot, _curves),
        ("fit", request.fit, _fits),
        ("map", request.map, _map),
    ):
        if wanted:
            found[name], lines = act(request, ladder)
            if not request.as_json:
                click.echo("\n".join(lines))
    if request.as_json:
        click.echo(json_text(_plain(found)))


Result = tuple[dict[str, Any], list[str]]
"""What was found, for JSON, and the lines that say so."""


def _points(request: ForcesRequest, ladder: Ladder) -> Result:
    """Forces at points, written; then the model's error there."""
    from otwarp.optics.exact import evaluate
    from otwarp.optics.points import read_points, write_forces

    assert request.points is not None and request.out is not None
    places = read_points(request.points)
    about: dict[str, Any] = {"file": str(request.out), "points": len(places), "model": request.model}
    if request.model == "exact" and request.device is None:
        result = evaluate(ladder.beam, ladder.sphere, places)
        write_forces(request.out, places, result.force)
        about["estimated_error"] = result.error
        return about, [f"wrote {request.out}: {len(places)} points, estimated error of Q {result.error:.1e}"]
    write_forces(request.out, places, ladder.force(request.model)(places))
    lines = [f"wrote {request.out}: {len(places)} points, {request.model}"]
    if request.model != "exact" and len(places):
        about["error"], line = _model_error(request.model, ladder, places)
        lines.append(line)
    return about, lines


def _model_error(model: str, ladder: Ladder, places: Any) -> tuple[Any, str]:
    import numpy as np

    chosen, where = places, "these points"
    if len(places) > MOST_POINTS:
        chosen = places[np.random.default_rng(0).choice(len(places), SOME_POINTS, replace=False)]
        where = f"{SOME_POINTS} of them, drawn at random"
    e = ladder.error(model, chosen)
    share = f"{100.0 * e.largest / e.peak:.2g} % and {100.0 * e.rms / e.peak:.2g} % of the peak {e.peak:.4g}"
    return e, f"error against exact on {where}: {e.largest:.3g} at most, {e.rms:.3g} rms in Q ({share})"


def _table(request: ForcesRequest, ladder: Ladder) -> Result:
    """The table's description."""
    from otwarp.optics import table_cache

    folder = table_cache.cache_folder()
    key = (ladder.beam, ladder.sphere, ladder.tolerance, ladder.interpolation)
    cached = table_cache.load(folder, *key) is not None
    start = time.perf_counter()
    t = ladder.table
    took = time.perf_counter() - start
    levels = [{"radius": v.radius, "spacing": v.spacing, "shape": list(v.node.shape)} for v in t.levels]
    about = {
        "tolerance": t.tolerance,
        "interpolation": t.interpolation,
        "error": t.error,
        "peak": t.peak,
        "cutoff": t.cutoff,
        "layers": t.layers,
        "why_layers": LAYERS[t.layers],
        "bytes": t.size,
        "levels": levels,
        "seconds": took,
        "cached": cached,
        "file": str(table_cache.file_of(folder, *key)),
    }
    lines = [
        f"table     {t.interpolation}; error on unseen points {t.error:.2e} of the peak, "
        f"{t.error / t.tolerance:.0%} of the tolerance {t.tolerance:g}",
        f"peak      |Q| = {t.peak:.4g}; 0 beyond the cut-off {t.cutoff:.4g} µm from the focus",
        f"layers    {t.layers}: {LAYERS[t.layers]}",
    ]
    for n, level in enumerate(t.levels):
        rows, columns = level.node.shape[:2]
        size = f"{columns} × {rows} nodes, {level.node.nbytes / 1024:,.0f} KiB"
        lines.append(f"level {n}   up to {level.radius:.4g} µm, spacing {level.spacing:.4g} µm: {size}")
    lines.append(f"memory    {t.size / 1024:,.0f} KiB")
    lines.append(f"made in   {took:.2g} s" if not cached else f"cached    read in {took:.2g} s from {about['file']}")
    return about, lines


def _curves(request: ForcesRequest, ladder: Ladder) -> Result:
    """Properties of the trap, and the picture of its curves."""
    p = ladder.properties
    k, f = p.stiffness, p.escape_force
    lines = [
        f"equilibrium   z = {p.equilibrium:.5f} µm from the focus",
        f"stiffness     {k[0]:.5g}, {k[1]:.5g}, {k[2]:.5g} pN/µm along x, y, z at {request.power:g} mW",
        f"escape force  {f[0]:.4g}, {f[1]:.4g} pN along x, y; {f[2]:.4g} pN downstream, {f[3]:.4g} pN upstream",
        f"depth         {p.depth:.4g} pN·µm = {p.depth / (BOLTZMANN * 298.15):.4g} k_BT at 298.15 K",
    ]
    if p.others:
        lines.append("also stable   z = " + ", ".join(f"{z:.4f}" for z in p.others) + " µm")
    about = dataclasses.asdict(p)
    if request.plot is not None:
        from otwarp.optics.curves import DRAWN, force_curves, plot_curves

        curves = force_curves(ladder)
        plot_curves(curves, request.plot)
        about["file"] = str(request.plot)
        about["rmse"] = {m: {"axial": curves.rmse(m, ("axial",)), "radial": curves.rmse(m, ("x", "y"))} for m in DRAWN}
        lines.append(f"wrote {request.plot}")
    return about, lines


def _fits(request: ForcesRequest, ladder: Ladder) -> Result:
    """Constants of the fitted laws, with their errors over the trap region."""
    from otwarp.optics.fit import fit_harmonic, weak_side

    kind = request.fit
    found = ladder.piecewise if kind == "piecewise" else fit_harmonic(ladder.beam, ladder.sphere, curves=ladder.curves)
    region, weak = next(iter(found.values())).region, weak_side(ladder.curves)
    sides = {
        "radial": "along x and y",
        "axial": weak if kind == "piecewise" else "both sides",
        "isotropic": f"radial and axial ({weak}) together",
    }
    about = {"kind": kind, **found}
    lines = [f"errors over the trap region: up to {region:.4g} µm (1.5 r + 2 λ) from the equilibrium"]
    if kind == "piecewise":
        about["continuous"] = request.continuous
        lines[0] += "; " + ("joined at δ, ending at zero" if request.continuous else "free: five constants per law")
    for name, f in found.items():
        w = f.law
        lines.append(f"{name}: {sides[name]}")
        constants = f"K = {w.stiffness:.5g} pN/µm"
        if kind == "piecewise":
            constants += f", δ = {w.threshold:.4g} µm, A = {w.inverse_square:.5g} pN·µm², C = {w.offset:.4g} pN"
            constants += f", cut-off {w.cutoff:.4g} µm" + ("" if request.continuous else f", jump {f.jump:.3g} pN at δ")
        else:
            constants += f", fitted up to {f.fitted:.3g} µm"
        errors = f"MSE {f.mse:.3e}, RMSE {f.rmse:.4g}, R² {f.r_squared:.4f} in Q"
        lines += [f"    {constants}", f"    {errors}; worst {f.worst:.3g} at {f.worst_at:.3g} µm"]
    return about, lines


def _map(request: ForcesRequest, ladder: Ladder) -> Result:
    """The picture of the force map, and how far its basin reaches."""
    from otwarp.optics.maps import force_map, plot_map

    assert request.map is not None
    found = force_map(ladder)
    plot_map(found, request.map)
    about = {
        "file": str(request.map),
        "azimuth": math.degrees(found.azimuth),
        "equilibrium": found.equilibrium,
        "escape_contour": found.reach,
    }
    lines = []
    if found.equilibrium is None:
        lines.append("equilibrium   none on the axis: the map has no escape contour")
    else:
        reach = ", ".join(f"{'beyond the map' if d is None else f'{d:.3g} µm'} {way}" for way, d in found.reach.items())
        lines.append(f"basin         {reach} of the equilibrium")
    return about, [*lines, f"wrote {request.map}"]


def _plain(value: Any) -> Any:
    """Dataclasses as dictionaries, what is infinite as null: JSON knows neither."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _plain(dataclasses.asdict(value))
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
