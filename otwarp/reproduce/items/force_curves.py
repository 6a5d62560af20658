"""Force curves of a trap: the paper's eq. 1 with the constants of its release, beside fits of exact forces."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from otwarp.haptics.chain.paper_mode import RELEASE_LAW
from otwarp.haptics.core.config import RELEASE_GAIN
from otwarp.laws import TrapLaw
from otwarp.optics import CurveFit, Particle
from otwarp.optics.fit import ForceCurves, pull, weak_side
from otwarp.reproduce.drawing import FAINT, OURS, OURS_TOO, PAPER, THIRD, drawn, letter, write_csv
from otwarp.reproduce.item import NOT_PUBLISHED, Comparison, Figure, Request, Result, Table, Value, shown
from otwarp.reproduce.items.handle import BEAM, HANDLE, exact_curves, fits

SAMPLES = {0.02: 240.0, 0.04: 480.0, 0.085: 671.4, 0.09: 429.5, 0.095: 224.8}
"""Force [raw units] at distances [scene units] as the release's code gives it."""

LARGEST_GAIN = 0.0030
"""Upper end of the paper's range of G_hand [N per raw unit]."""

RADII = (0.5, 1.0, 1.525, 2.5)
"""Of other spheres that are fitted [µm]."""

DEFINITION = """Eq. 1 is F(d) = K·d for d < δ, A/d² + C from δ to a cutoff, 0 beyond, with d the distance from the
trap. The paper samples the Optical Tweezers Toolbox and fits this law, along the beam (axial) and across it (radial);
its release has one set of constants for both, in raw force over scene units. Ours: exact forces (generalised
Lorenz–Mie theory, equal to the toolbox within 4·10⁻⁹ in Q on ten beams and spheres, `tests/optics/test_exact.py`) on
the sphere of a handle, radius 1.525 µm, index 1.52, in water, 1064 nm, NA 1.25, circular, 20 mW; least squares over
the trap region, 1.5 r + 2 λ from the equilibrium, with the two branches joined (three free constants) or free (five).
MSE, RMSE and R² = 1 − Σ(fit − exact)²/Σ(exact − mean)² are taken over 160 distances, in Q = F·c/(n·P)."""

DIFFERENCE = """Constants cannot agree: the release's are in raw units and scene units. What can be compared is the
shape. In units of δ and of the force there, the release's law ends at 1.25 δ with a jump from 5 % of its peak to
zero; exact forces fall more slowly, and their fits end between 1.2 and 2 δ. The exact radial curve is steeper than a
line before its peak, so eq. 1 follows it with R² of 0.92 to 0.94; the axial one on the weak side, where a sphere is
lost, is nearly eq. 1. If the release's δ = 0.08 is the place where our forces are largest, its scene unit is some 20
µm."""

INCOMPARABLE = (
    "Beam, power, sphere and index behind the paper's samples are not published, nor are the samples or the quality "
    "of the "
    "fit: its R² of 0.9525 and 0.9268 are of rendered against fitted force (item `rendering`), not of the fit.",
    "The release has one curve for all directions; which of the two published ones it is, it does not say.",
)


def run(request: Request) -> Result:
    """Evaluate, fit, compare, draw."""
    curves, joined, free = exact_curves(), fits(), fits(continuous=False)
    request.say("fits of other spheres")
    others = {r: {c: fits(BEAM, Particle(radius=r, index=HANDLE.index), continuous=c) for c in (True, False)}
              for r in RADII}  # fmt: skip
    _write(request.folder, curves, joined, free)
    _draw(request.folder / "force_curves.png", curves, joined, free)
    laws = {"release": RELEASE_LAW, **{axis: joined[axis].law for axis in ("radial", "axial")}}
    unit = {axis: laws[axis].threshold / RELEASE_LAW.threshold for axis in ("radial", "axial")}
    worst = max(abs(float(pull(RELEASE_LAW, np.array([d]))[0]) - f) for d, f in SAMPLES.items())
    return Result(
        comparisons=_comparisons(joined, free, unit, worst),
        definition=DEFINITION,
        difference=DIFFERENCE,
        incomparable=INCOMPARABLE,
        computed={"exact forces": "160 distances along x, y, up and down the beam, float64",
                  "statistics": "none: nothing random; the same on every machine to rounding"},
        tables=(_constants(joined, free), _spheres(others)),
        figures=(Figure(file="force_curves.png", caption="Force curves of a handle's sphere at 20 mW. (a) The "
                                                         "release's "
                        "eq. 1 with values its code gives. (b, c) Exact force (wide, pale) and fits of eq. 1 across "
                        "the "
                        "beam and along it. (d) All in units of their own δ and F(δ)."),),
        files={"curves.csv": "exact force and fits over distance"},
        numbers={"fits": {f"{axis} {kind}": _said(fit[axis]) for kind, fit in (("joined", joined), ("free", free))
                          for axis in ("radial", "axial", "isotropic")}, "scene_unit_um": unit},
    )  # fmt: skip


def _said(fit: CurveFit) -> dict[str, float]:
    one = fit.law
    return {
        "stiffness_pn_um": one.stiffness,
        "threshold_um": one.threshold,
        "inverse_square_pn_um2": one.inverse_square,
        "offset_pn": one.offset,
        "cutoff_um": one.cutoff,
        "mse": fit.mse,
        "rmse": fit.rmse,
        "r_squared": fit.r_squared,
    }


def _comparisons(
    joined: dict[str, CurveFit], free: dict[str, CurveFit], unit: dict[str, float], worst: float
) -> tuple[Comparison, ...]:
    release, rows = RELEASE_LAW, []
    peak = release.stiffness * release.threshold
    rows.append(Comparison(what="eq. 1 at five distances, the release's code", unit="raw", grade="S",
                           paper=Value(text=", ".join(f"{f:g}" for f in SAMPLES.values())),
                           ours=Value(number=worst, text="the same, to their last digit" if worst < 0.051 else f"off "
                                                                                                               f"by "
                                                                                                               f"{worst:.2g}"),
                           remark="`--mode paper` evaluates this law"))  # fmt: skip
    for axis in ("radial", "axial"):
        one = joined[axis].law
        rows += [
            Comparison(what=f"cutoff over δ, {axis}", grade="S",
                       paper=Value(number=release.cutoff / release.threshold),
                       ours=Value(number=one.cutoff / one.threshold), remark="shape, free of units"),
            Comparison(what=f"R² of the fit, {axis}", paper=NOT_PUBLISHED, ours=Value(number=joined[axis].r_squared,
                       text=f"{joined[axis].r_squared:.4f}"),
                       remark=f"joined; free branches {free[axis].r_squared:.4f}"),
            Comparison(what=f"RMSE of the fit, {axis}", unit="Q", ours=Value(number=joined[axis].rmse),
                       remark=f"MSE {shown(joined[axis].mse)}"),
        ]  # fmt: skip
    jump = free["axial"].jump
    outer = release.inverse_square / release.cutoff**2 + release.offset
    rows += [
        Comparison(what="force just inside the cutoff, over the peak", grade="D", paper=Value(number=outer / peak),
                   ours=Value(number=0.0, text="0"), remark="a jump that the release's hand would feel"),
        Comparison(what="jump at δ, axial", unit="pN", grade="D", paper=Value(number=None, text="0.1 of 960 raw"),
                   ours=Value(number=jump), remark="free branches; 0 when joined"),
        Comparison(what="peak force on the hand", unit="N", grade="D",
                   paper=Value(text=f"{peak * RELEASE_GAIN:.2f} to {peak * LARGEST_GAIN:.2f}"),
                   ours=Value(text="clamped at 3.3"), remark="the release clamps nothing"),
        Comparison(what="scene unit", unit="µm", grade="D", paper=Value(text="15 to 35"),
                   ours=Value(text=f"{shown(unit['radial'])} radial, {shown(unit['axial'])} axial"),
                   remark="our δ over the release's 0.08"),
    ]  # fmt: skip
    return tuple(rows)


def _constants(joined: dict[str, CurveFit], free: dict[str, CurveFit]) -> Table:
    def row(name: str, law: TrapLaw, fit: CurveFit | None) -> tuple[str, ...]:
        cells = [shown(v, 4) for v in (law.stiffness, law.threshold, law.inverse_square, law.offset, law.cutoff)]
        quality = [f"{fit.rmse:.4f}", f"{fit.r_squared:.4f}"] if fit else ["–", "–"]
        return (name, *cells, *quality)

    rows = [row("release, raw and scene units", RELEASE_LAW, None)]
    for kind, found in (("joined", joined), ("free", free)):
        rows += [
            row(f"ours, {axis}, {kind}", found[axis].law, found[axis]) for axis in ("radial", "axial", "isotropic")
        ]
    head = ("law", "K [pN/µm]", "δ [µm]", "A [pN·µm²]", "C [pN]", "cutoff [µm]", "RMSE [Q]", "R²")
    return Table(title="Constants of eq. 1", head=head, rows=tuple(rows), note="Ours at 20 mW, radius 1.525 µm.")


def _spheres(others: dict[float, dict[bool, dict[str, CurveFit]]]) -> Table:
    rows = []
    for radius, found in others.items():
        for axis in ("radial", "axial"):
            fit, free = found[True][axis], found[False][axis]
            shape = (shown(fit.law.threshold / radius), shown(fit.law.cutoff / fit.law.threshold))
            quality = (f"{fit.rmse:.4f}", f"{fit.r_squared:.4f}", f"{free.r_squared:.4f}")
            rows.append((f"{radius:g}, {axis}", *shape, *quality))
    return Table(title="How well eq. 1 fits spheres of other radii", rows=tuple(rows),
                 head=("radius [µm]", "δ/r", "cutoff/δ", "RMSE [Q]", "R², joined", "R², free"))  # fmt: skip


def _write(folder: Path, curves: ForceCurves, joined: dict[str, CurveFit], free: dict[str, CurveFit]) -> None:
    d = curves["downstream"][0]
    radial = curves["radial"][1][: len(d)]
    weak = curves[weak_side(curves)][1]
    columns = {"distance_um": d, "exact_radial_q": radial, "exact_axial_q": weak}
    for kind, found in (("joined", joined), ("free", free)):
        columns |= {f"{kind}_{axis}_q": pull(found[axis].law, d) / BEAM.force_scale for axis in ("radial", "axial")}
    write_csv(folder / "curves.csv", columns)


def _draw(path: Path, curves: ForceCurves, joined: dict[str, CurveFit], free: dict[str, CurveFit]) -> None:
    with drawn(path, panels=(2, 2), size=(7.2, 5.2)) as ((one, two), (three, four)):
        d = np.linspace(0.0, 0.13, 600)
        one.plot(d, pull(RELEASE_LAW, d), color=PAPER)
        one.plot(list(SAMPLES), list(SAMPLES.values()), "o", ms=4, color=PAPER, mfc="white", label="the release's code")
        one.set(xlabel="distance (scene units)", ylabel="force (raw units)", ylim=(-30, None))
        one.legend()
        letter(one, "a", "eq. 1 of the release")
        weak = weak_side(curves)
        shownaxes = (
            (two, "b", "radial", "radial", "across the beam"),
            (three, "c", weak, "axial", f"along it, {weak}"),
        )
        for axes, which, key, axis, title in shownaxes:
            x, q = curves[key][0], curves[key][1]
            half = len(curves["downstream"][0])
            axes.plot(x[:half], q[:half], color="#c3ccda", lw=5, label="exact")
            fine = np.linspace(0.0, x.max(), 1200)
            for name, found, colour, line in (("joined", joined, OURS, "-"), ("free", free, THIRD, (0, (4, 2)))):
                fit = found[axis]
                axes.plot(fine, pull(fit.law, fine) / BEAM.force_scale, color=colour, ls=line,
                          label=f"{name}, R² {fit.r_squared:.4f}")  # fmt: skip
            axes.set(xlabel="distance from the equilibrium (µm)", ylabel="restoring force (Q)")
            axes.legend(loc="upper right")
            letter(axes, which, title)
        x = np.linspace(0.0, 2.6, 900)
        four.axhline(0.0, color=FAINT, lw=0.5)
        laws = {"release": RELEASE_LAW, "ours, radial": joined["radial"].law, "ours, axial": joined["axial"].law}
        looks = ((PAPER, "-", 4.0), (OURS, "-", 1.4), (OURS_TOO, (0, (4, 2)), 1.4))
        for (name, law), (colour, line, width) in zip(laws.items(), looks, strict=True):
            y = pull(law, x * law.threshold) / (law.stiffness * law.threshold)
            four.plot(x, y, color=colour, ls=line, lw=width, label=name)
        four.set(xlabel="distance over δ", ylabel="force over F(δ)")
        four.legend()
        letter(four, "d", "the shapes")
