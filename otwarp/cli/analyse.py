"""`otwarp analyse`: what a recorded run or a study tells, with intervals."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from otwarp.cli.options import json_option, seed_option
from otwarp.cli.output import json_text, tables_console, with_room
from otwarp.cli.types import FILE, POSITIVE, SECONDS, Number, OutputPath
from otwarp.errors import InputError

CURVES = {"psd": "power spectrum", "msd": "MSD", "acf": "autocorrelation"}
"""Curve that can be drawn → the calibration that fits it."""

AXES = "xyz"

Found = dict[str, Any]
"""What was found by name, Datasets as pictures take them."""


class Vector(click.ParamType):
    """Three finite numbers, as 10,0,0."""

    name = "x,y,z"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read them.

        Raises:
            InputError: Others.
        """
        try:
            numbers = tuple(float(part) for part in str(value).split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != 3 or not all(math.isfinite(n) for n in numbers):
            raise InputError(f"--flow is {value}; allowed: three numbers, as 10,0,0")
        return numbers


@click.command(
    epilog="""\b
Examples:
  otwarp analyse out/single_bead/run.nc --psd --msd --calibrate --plot calib.png
  otwarp analyse out/single_bead --calibrate --detector rate=100,exposure=0.005,noise=0.01
  otwarp analyse out/drag --drag                       # a run whose trap moves at constant speed
  otwarp analyse out/pull --work                       # many worlds: Jarzynski
  otwarp analyse out/capture                           # a study: escapes at each point"""
)
@click.argument("path", type=FILE)
@click.option("--body", metavar="NAME", help="Which body; default: the first that a trap holds.")
@click.option("--axis", default=AXES, show_default=True, help="Which axes, as xy.")
@click.option("--world", type=Number(0, whole=True), help="Which world; default: all, as repeats.")
@click.option("--from", "start", type=Number(0.0, unit="s"), default=0.0, help="Leave out what is before [s].")
@click.option("--until", type=SECONDS, default=None, help="Leave out what is after [s].")
@click.option("--psd", is_flag=True, help="Power spectrum, and the trap that fits it.")
@click.option("--msd", is_flag=True, help="Mean squared displacement, and the trap that fits it.")
@click.option("--acf", is_flag=True, help="Autocorrelation, and the trap that fits it.")
@click.option("--calibrate", is_flag=True, help="All calibrations by fluctuations; the default.")
@click.option("--drag", is_flag=True, help="Calibrate by the drag on a trap that moves, or in --flow.")
@click.option(
    "--flow", type=Vector(), metavar="X,Y,Z", help="Velocity of the liquid for --drag [µm/s]; default: 0,0,0."
)
@click.option("--escapes", is_flag=True, help="When traps lost what they hold.")
@click.option("--work", is_flag=True, help="Work of moving the traps, and the free energy it tells (Jarzynski).")
@click.option("--rotation", is_flag=True, help="Of orientations instead of positions: torsional stiffness.")
@click.option("--detector", metavar="LIST", help="See the run through a detector first: rate=1/s, exposure=s, "
              "noise=µm, drift=µm/s, cutoff=Hz, order, passed.")  # fmt: skip
@click.option("--stokes", is_flag=True, help="Take the drag of a lone sphere as known, not from fluctuations.")
@click.option("--temperature", type=POSITIVE, help="[K]; default: that of the run.")
@click.option("--level", type=Number(0.5, 0.9999), default=0.95, show_default=True, help="Of the intervals.")
@click.option("--plot", type=OutputPath(), metavar="FILE", help="Draw into FILE: .png, .svg or .pdf.")
@seed_option
@json_option
def analyse(path: Path, **asked: Any) -> None:
    """Say what the run or study in PATH tells, with intervals: stiffness and drag, escapes, work.

    PATH is the folder of a recorded run, its run.nc, or the folder of a study.
    """
    from otwarp.analysis.detector import Detector
    from otwarp.analysis.figure import check_plot, draw_analysis

    if asked["plot"] is not None:
        check_plot(asked["plot"])
    if not asked["axis"] or set(asked["axis"]) - set(AXES) or len(set(asked["axis"])) != len(asked["axis"]):
        raise InputError(f"--axis is {asked['axis']}; allowed: some of x, y, z, as xy")
    asked["detector"] = None if asked["detector"] is None else Detector.parse(asked["detector"])
    if (path / "study.json").is_file():
        _study(path, asked)
        return
    curves = [name for name in CURVES if asked[name]]
    if not (curves or asked["calibrate"] or asked["drag"] or asked["escapes"] or asked["work"]):
        asked["calibrate"] = True
    console = tables_console(120)
    with console.capture() as text:  # nothing is said before all is known to be good
        found, said = _run(path, asked, curves, None if asked["as_json"] else console)
    if asked["plot"] is not None:
        with with_room(asked["plot"]):
            draw_analysis(found, asked["plot"])
    if asked["as_json"]:
        click.echo(json_text(_plain(said)))
        return
    click.echo(text.get(), nl=False)
    if asked["plot"] is not None:
        click.echo(f"wrote {asked['plot']}")


def _run(path: Path, asked: dict[str, Any], curves: list[str], console: Any) -> tuple[Found, dict[str, Any]]:
    """What is asked of a run: for the picture, and for JSON; printed to the console, if there is one."""
    from otwarp.analysis.trajectory import load_trajectory

    found: Found = {}
    said: dict[str, Any] = {}
    if curves or asked["calibrate"] or asked["drag"] or asked["work"]:
        bead = load_trajectory(
            path,
            body=asked["body"],
            world=asked["world"],
            start=asked["start"],
            end=math.inf if asked["until"] is None else asked["until"],
            rotation=asked["rotation"],
        )
        if asked["temperature"] is not None:
            bead.attrs["temperature"] = asked["temperature"]
        said |= _about(bead, console)
        if curves or asked["calibrate"] or asked["drag"]:
            _calibrations(bead.sel(axis=list(asked["axis"])), asked, curves, found, said)
            if console is not None:
                _print_calibrations(found["calibration"], asked["rotation"], console)
        if asked["work"]:
            _work(bead, asked, found, said, console)
    if asked["escapes"]:
        _escapes(path, asked, found, said, console)
    return found, said


def _about(bead: Any, console: Any) -> dict[str, Any]:
    samples, worlds = bead.sizes["time"], bead.sizes["world"]
    time = bead["time"].values
    interval = float(time[-1] - time[0]) / max(samples - 1, 1)
    kelvin = bead.attrs["temperature"]
    if console is not None:
        worlds_text = "1 world" if worlds == 1 else f"{worlds} worlds"
        at = f"{kelvin:g} K" if math.isfinite(kelvin) else "unknown temperature"
        console.print(f"{bead.attrs['body']}: {samples} samples, {1e3 * interval:.4g} ms apart, in {worlds_text}; {at}")
    return {
        "body": bead.attrs["body"],
        "samples": samples,
        "worlds": worlds,
        "interval": interval,
        "temperature": kelvin,
    }


def _calibrations(bead: Any, asked: dict[str, Any], curves: list[str], found: Found, said: dict[str, Any]) -> None:
    """Calibrations that are asked for, one table; curves of the picture."""
    from otwarp.analysis.curves import fitted_curves
    from otwarp.analysis.drag import drag_calibration
    from otwarp.analysis.methods import METHODS, calibrate
    from otwarp.analysis.tracks import xarray

    detector = asked["detector"]
    known = bead.attrs["drag"] if asked["stokes"] else None
    if known is not None and not math.isfinite(known):
        raise InputError(f"--stokes: the drag of {bead.attrs['body']} is unknown; allowed with a lone sphere")
    methods = list(METHODS) if asked["calibrate"] else [CURVES[name] for name in curves]
    tables = []
    if methods:
        options = {"drag": known, "detector": detector, "seed": asked["seed"], "level": asked["level"]}
        tables.append(calibrate(bead, methods=methods, **options))
    if asked["drag"]:
        flow = asked["flow"] or (0.0, 0.0, 0.0)
        chosen = [flow[AXES.index(a)] for a in bead["axis"].values]
        tables.append(drag_calibration(bead, flow=chosen, level=asked["level"]).expand_dims(estimator=["drag"]))
    xr = xarray()
    table = (
        tables[0]
        if len(tables) == 1
        else xr.concat(tables, "estimator", data_vars="all", join="outer", combine_attrs="override")
    )
    found["calibration"] = table
    rows = table[[v for v in table.data_vars if v.startswith(("stiffness", "drag"))]].to_dataframe().reset_index()
    said["calibration"] = rows.to_dict("records")
    said["known_drag"] = bead.attrs["drag"]
    said["notes"], said["warnings"] = table.attrs.get("notes", ""), table.attrs.get("warnings", "")
    if "known_stiffness" in table:
        known_k = table["known_stiffness"]
        known_k = known_k.isel(estimator=0) if "estimator" in known_k.dims else known_k
        table["known_stiffness"] = known_k
        said["known_stiffness"] = dict(zip(known_k["axis"].values.tolist(), known_k.values.tolist(), strict=True))
    if curves:
        seen = bead["displacement"] if detector is None else detector.see(bead["displacement"], seed=asked["seed"])
        drawn = fitted_curves(seen, detector=detector)
        found |= {name: drawn[name] for name in curves}
        said["curves"] = {name: drawn[name].to_dict()["data_vars"] | drawn[name].to_dict()["coords"] for name in curves}


def _print_calibrations(table: Any, rotation: bool, console: Any) -> None:
    from rich.table import Table

    per = "pN µm/rad" if rotation else "pN/µm"
    grid = Table(box=None)
    for name in ("axis", "method"):
        grid.add_column(name)
    slow = "pN µm s/rad" if rotation else "pN s/µm"
    level = f"{100.0 * table.attrs['level']:g} %"
    for name in (f"stiffness ({per})", level, f"drag ({slow})", level):
        grid.add_column(name, justify="right")
    grid.add_column("", no_wrap=True)
    missed = False
    for axis in table["axis"].values:
        one = table.sel(axis=axis)
        for method in table["estimator"].values:
            row = one.sel(estimator=method)
            cells = [text for name in ("stiffness", "drag") for text in _spelled(row, name)]
            known = {"stiffness": one.get("known_stiffness", math.nan), "drag": table.attrs.get("known_drag", math.nan)}
            outside = [name for name, value in known.items() if _misses(row, name, float(value))]
            grid.add_row(str(axis), str(method), *cells, f"{MISSES} ({', '.join(outside)})" if outside else "")
            missed = missed or bool(outside)
        if "known_stiffness" in one:
            drag = table.attrs.get("known_drag", math.nan)
            grid.add_row(str(axis), "the twin's own", f"{float(one['known_stiffness']):.4g}", "", _number(drag), "")
    console.print(grid)
    if missed:
        console.print(
            f"{MISSES}: the interval does not hold the twin's own value. Chance does that to "
            f"{100.0 * (1.0 - table.attrs['level']):.3g} % of them;\n"
            "several tell of a run that is not stationary, or of a force that is no spring"
        )
    if table.attrs.get("notes"):
        console.print(table.attrs["notes"])


MISSES = "misses"
"""Mark of an interval that does not hold what the twin knows."""


def _misses(row: Any, name: str, known: float) -> bool:
    """Whether an interval that was estimated leaves out what is known."""
    if name not in row:
        return False
    low, high = float(row[f"{name}_low"]), float(row[f"{name}_high"])
    return math.isfinite(known) and low < high and not low <= known <= high


def _spelled(row: Any, name: str) -> tuple[str, str]:
    if name not in row:
        return "–", ""
    value, low, high = (float(row[f"{name}{end}"]) for end in ("", "_low", "_high"))
    if math.isnan(value) and not math.isfinite(high):
        return "–", "" if math.isnan(low) else f"{low:.4g} …"
    return f"{value:.4g}", "known" if low == high else f"{low:.4g} … {high:.4g}"


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "–"


def _work(bead: Any, asked: dict[str, Any], found: Found, said: dict[str, Any], console: Any) -> None:
    from otwarp.analysis.free_energy import jarzynski, work
    from otwarp.units import BOLTZMANN

    done = work(bead)
    kelvin = bead.attrs["temperature"]
    about = jarzynski(done.values, temperature=kelvin, level=asked["level"], seed=asked["seed"])
    found["work"] = about.assign(work=("world", done.values))
    said["work"] = {name: float(about[name]) for name in about.data_vars} | {"unit": "pN µm"}
    if console is not None:
        thermal = BOLTZMANN * kelvin
        for name, text in (
            ("mean_work", "mean work"),
            ("free_energy", "ΔF (Jarzynski)"),
            ("cumulant", "ΔF (second cumulant)"),
        ):
            value, low, high = (float(about[f"{name}{end}"]) / thermal for end in ("", "_low", "_high"))
            console.print(f"{text:21} {value:.4g} k_BT ({low:.4g} … {high:.4g})")
        console.print(f"{'largest term':21} {100.0 * float(about['rare']):.2g} % of the exponential average")


def _escapes(path: Path, asked: dict[str, Any], found: Found, said: dict[str, Any], console: Any) -> None:
    from otwarp.analysis.lifetimes import escape_survival, escapes

    rates = escapes(path, world=asked["world"], level=asked["level"])
    found["survival"] = escape_survival(path, world=asked["world"], level=asked["level"])
    rows = rates.to_dataframe().reset_index()
    said["escapes"] = rows.to_dict("records")
    if console is not None:
        _print_rows(rows, console)


def _study(path: Path, asked: dict[str, Any]) -> None:
    """Escapes at each point of a study."""
    from otwarp.analysis.lifetimes import study_escapes

    others = [n for n in (*CURVES, "calibrate", "drag", "work", "rotation", "stokes") if asked[n]]
    others += [n for n in ("body", "world", "until", "flow", "detector", "temperature", "plot") if asked[n] is not None]
    if others:
        raise InputError(f"--{others[0]} with a study; allowed: --escapes, --json (pictures: otwarp study show --plot)")
    table = study_escapes(path)
    rows = (table if table.sizes else table.expand_dims("point")).to_dataframe().reset_index()
    if asked["as_json"]:
        click.echo(json_text(_plain(rows.to_dict("records"))))
    else:
        _print_rows(rows.head(ROWS), tables_console(40 + 14 * len(rows.columns)))
        if len(rows) > ROWS:
            click.echo(f"… {len(rows) - ROWS:,} more; all of them: --json")


ROWS = 40
"""Points of a study that are printed, at most."""


def _print_rows(rows: Any, console: Any) -> None:
    from rich.table import Table

    units = {"exposure": "exposure (s)", "rate": "rate (1/s)", "rate_low": "from", "rate_high": "to"}
    grid = Table(box=None)
    for name in rows.columns:
        grid.add_column(units.get(name, str(name)), justify="left" if name == "trap" else "right")
    for row in rows.itertuples(index=False):
        grid.add_row(*(f"{v:.4g}" if isinstance(v, float) else str(v) for v in row))
    console.print(grid)


def _plain(value: Any) -> Any:
    """Arrays as lists, what is not finite as null: JSON knows neither."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
