"""`otwarp info`: what a scene holds and how it will be stepped."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli.options import device_option, json_option, scene_argument, step_options, worlds_option
from otwarp.cli.output import json_text, tables_console

if TYPE_CHECKING:
    from rich.table import Table


@click.command()
@scene_argument
@worlds_option
@step_options
@device_option
@click.option("--kernels", is_flag=True, help="Compile the kernels, and say what a CUDA device keeps for them.")
@json_option
def info(
    scene: Path,
    worlds: int,
    options: dict[str, Any],
    device: str | None,
    kernels: bool,
    as_json: bool,
) -> None:
    """Print the bodies, traps, time scales and chosen step of SCENE, the terms compiled in and left out, and memory."""
    from otwarp.scene import Scene
    from otwarp.simulation.info import describe
    from otwarp.simulation.options import StepOptions

    loaded = Scene.load(scene)
    chosen = StepOptions(**options)
    about = describe(loaded, worlds=worlds, device=device, options=chosen, kernels=kernels)
    if as_json:
        click.echo(json_text(about))
    else:
        _print(about)


def _time(seconds: float | None) -> str:
    if seconds is None:
        return "–"
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def _accuracy(row: dict[str, Any]) -> str:
    if row["model"] == "exact":
        return "exact"
    return f"{row['table_error']:.1e} ({row['interpolation']}, {row['bytes'] / 1e3:.0f} kB)"


def _optics_table(rows: list[dict[str, Any]], root: str) -> Table:
    from rich.table import Table

    columns = (
        "traps",
        "sphere",
        "k_x, k_y, k_z (pN/µm)",
        "equilibrium (µm)",
        "escape x, y, +z, −z (pN)",
        "table error",
        "ends at (µm)",
    )
    table = Table(*columns, title="Optical forces at 1 mW")
    for row in rows:
        names = [name.removeprefix(root) for name in row["traps"]]
        table.add_row(
            names[0] if len(names) == 1 else f"{names[0]} + {len(names) - 1}",
            f"r {row['radius']:g} µm, n {row['index']:g}",
            ", ".join(f"{k:.3g}" for k in row["stiffness"]) if row["stiffness"] else "not held",
            f"{row['equilibrium']:.4f}" if row["stiffness"] else "–",
            ", ".join(f"{f:.3g}" for f in row["escape_force"]) if row["stiffness"] else "–",
            _accuracy(row),
            f"{row['cutoff']:.3g}" + (f", {row['beyond']:.1e} of the peak left out" if row["beyond"] else ""),
        )
    return table


def _bodies_table(rows: list[dict[str, Any]], root: str) -> Table:
    from rich.table import Table

    bodies = Table(
        "body", "kind", "spheres", "rods", "trapped", "collide", "D_t (µm²/s)", "D_r (rad²/s)", title="Bodies"
    )
    for row in rows:
        bodies.add_row(
            row["name"].removeprefix(root),
            row["kind"] if row["count"] == 1 else f"{row['count']} × {row['kind']}",
            *(str(row[k]) for k in ("spheres", "rods", "trapped", "colliding")),
            f"{row['translational_diffusion']:.4g}",
            f"{row['rotational_diffusion']:.4g}",
        )
    return bodies


def _traps_table(rows: list[dict[str, Any]], root: str) -> Table:
    from rich.table import Table

    traps = Table("trap", "model", "power (mW)", "k_r (pN/µm)", "k_z (pN/µm)", "reach (µm)", "holds", title="Traps")
    for row in rows:
        traps.add_row(
            row["name"].removeprefix(root),
            row["model"].replace("_", " "),
            f"{row['power']:g}",
            f"{row['radial_stiffness']:.4g}",
            f"{row['axial_stiffness']:.4g}",
            "∞" if row["reach"] is None else f"{row['reach']:.4g}",
            (row["holds"] or "–").removeprefix(root),
        )
    return traps


def _forces_table(rows: list[dict[str, Any]], root: str) -> Table:
    from rich.table import Table

    table = Table("force", "acts on", "bodies", "parameters", "bounds", title="Forces with parameters")
    for row in rows:
        names = [name.removeprefix(root) for name in row["bodies"]]
        table.add_row(
            row["name"],
            row["acts_on"],
            names[0] if len(names) == 1 else f"{len(names)} bodies",
            ", ".join(f"{name} {_span(p)}" for name, p in row["parameters"].items()),
            row["bounds"],
        )
    return table


def _span(parameter: dict[str, Any]) -> str:
    """A parameter's value, or its least and greatest, and its unit."""
    low, high = parameter["low"], parameter["high"]
    text = f"{low}" if low == high else f"{low} … {high}"
    return text if parameter["unit"] == "1" else f"{text} {parameter['unit']}"


def _error(error: float | None, scales: dict[str, Any]) -> str:
    """An estimated error; above the wanted accuracy it says so."""
    from otwarp.simulation.time_step.observables import percent

    text = percent(error)
    wanted = scales["accuracy"]
    return (
        text
        if error is not None and abs(error) <= wanted
        else f"[yellow]{text}, above the wanted {100 * wanted:g} %[/]"
    )


def _scales_table(about: dict[str, Any]) -> Table:
    from rich.table import Table

    from otwarp.simulation.time_step.observables import OBSERVABLES

    scales = about["time_scales"]
    table = Table("quantity", "value", title="Time scales", show_header=False)
    for name, value in (
        ("fastest relaxation in the traps", _time(scales["trap_relaxation"])),
        ("… of body", scales["stiffest_body"] or "–"),
        ("diffusion over 0.1 of the smallest colliding radius", _time(scales["diffusion"])),
        ("prescribed motion over the same distance", _time(scales["travel"])),
        ("diffusion or fall over a radius, near hydrodynamic walls", _time(scales["wall"])),
        ("sinking or rising over the same distance", _time(scales["settling"])),
        ("approach under adhesion over the same distance", _time(scales["adhesion"])),
        ("turning of rigid bodies by 0.1 rad", _time(scales["turning"])),
        ("largest stable step", _time(scales["largest_stable"])),
        ("time step", f"{_time(scales['time_step'])}  ({scales['chosen_by']})"),
        ("integrator", scales["integrator"] + (f"  ({why})" if (why := about["integrator_reason"]) else "")),
        ("noise", about["noise"]),
        *((f"estimated error of {OBSERVABLES[name]}", _error(e, scales)) for name, e in scales["errors"].items()),
        ("steps of the run", f"{about['steps']:,}" if about["steps"] is not None else "more than there are numbers"),
    ):
        table.add_row(name, value)
    return table


def _terms_table(about: dict[str, Any]) -> Table:
    from rich.table import Table

    step = f"driver: {about['driver']}, {about['precision']}{', fast math' if about['fast_math'] else ''}"
    terms = Table("term", "compiled", "why", title=f"Terms of the step ({step})")
    for row in about["terms"]:
        terms.add_row(row["term"], "[green]in[/green]" if row["compiled"] else "[dim]out[/dim]", row["why"])
    return terms


def _flow_line(flow: dict[str, Any]) -> str:
    nodes = " × ".join(map(str, flow["nodes"]))
    return (
        f"Velocity field {flow['file']}: {nodes} nodes, up to {flow['fastest']:.4g} µm/s; root mean square of its"
        f" divergence over that of its gradient {flow['divergence']:.2g}, at most {flow['largest_divergence']:.2g} 1/s"
    )


def _kernels_line(kernels: list[dict[str, Any]] | None) -> str:
    if kernels is None:
        return "Memory that the device keeps for the kernels: known once they are compiled (--kernels compiles them)"
    largest = kernels[0]
    return (
        f"Memory that the device keeps for the kernels: {largest['reserved'] / 2**20:,.1f} MiB, for"
        f" {largest['local']:,} bytes of local memory in each thread of {largest['kernel']}"
        f" ({largest['registers']} registers)"
    )


def _print(about: dict[str, Any]) -> None:
    console = tables_console(140)
    root = about["root"].rstrip("/") + "/"
    console.print(f"[bold]{about['scene']}[/bold]: {about['duration']:g} s at {about['frames_per_second']:g} frames/s")
    console.print(_bodies_table(about["bodies"], root))
    if about["traps"]:
        console.print(_traps_table(about["traps"], root))
    if about["optics"]:
        console.print(_optics_table(about["optics"], root))
    if about["forces"]:
        console.print(_forces_table(about["forces"], root))
    if about["flow"] is not None and "nodes" in about["flow"]:
        console.print(_flow_line(about["flow"]))
    console.print(_scales_table(about))
    console.print(_terms_table(about))
    each = about["memory_per_world"]
    scratch = about["worlds"] * each["scratch"]
    console.print(
        f"Memory of arrays for {about['worlds']} world(s) on {about['device']}: "
        f"{(about['memory'] + scratch) / 1024:,.1f} KiB, of it each world {each['state'] / 1024:,.2f} KiB"
        + (f" and {each['scratch'] / 1024:,.1f} KiB of scratch" if scratch else "")
    )
    if about["device"] != "cpu":
        console.print(_kernels_line(about["kernels"]))
