"""`otwarp operators sweep`: simulated operators with late and wrong estimates of where their robots are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option, mode_option, scene_argument, seed_option
from otwarp.cli.progress import parts
from otwarp.cli.types import COUNT, SECONDS, Number, OutputPath, Values

MS = Number(0.0, 1000.0, unit="ms")
MICRONS = Number(0.0, 100.0, unit="µm")
DEGREES = Number(0.0, 180.0, unit="°")
RATE = Number(1.0, 20_000.0, unit="Hz")
BIAS = Number(-100.0, 100.0, unit="µm")


@click.command()
@scene_argument
@click.option("-o", "--out", type=OutputPath(folder=True), metavar="DIR", default="out/latency", show_default=True,
              help="Folder of the sweep.")  # fmt: skip
@click.option("--delay", type=Values(MS), metavar="MS", default="0:500:50", show_default=True,
              help="From a picture to the chain.")  # fmt: skip
@click.option("--depth-error", type=Values(MICRONS), metavar="UM", default="0", show_default=True,
              help="Standard deviation of the depth, of every picture and robot.")  # fmt: skip
@click.option("--depth-range", type=Number(0.0, 1000.0, above=True, unit="µm"), metavar="UM",
              help="Take --depth-error as parts of this range, as of normalised depths.")  # fmt: skip
@click.option("--pose-error", type=Values(DEGREES), metavar="DEG", default="0", show_default=True,
              help="Standard deviation of the tilt out of the plane.")  # fmt: skip
@click.option("--lateral-error", type=Values(MICRONS), metavar="UM", default="0", show_default=True,
              help="Standard deviation along x and along y.")  # fmt: skip
@click.option("--frame-rate", type=Values(RATE), metavar="HZ", default="120", show_default=True,
              help="Pictures per second that estimates are made of.")  # fmt: skip
@click.option("--yaw-error", type=DEGREES, default=0.0, help="Standard deviation of the turn in the plane.")
@click.option("--correlation", type=Number(0.0, 1e7, unit="ms"), default=0.0,
              help="Time in which errors are forgotten; default: none, every picture anew.")  # fmt: skip
@click.option("--depth-bias", type=BIAS, default=0.0, help="Added to every depth.")
@click.option("--lost", type=Number(0.0, 0.99), default=0.0, help="Part of the pictures without an estimate.")
@click.option("--unstamped", is_flag=True, help="Late estimates stand beside the traps of now, not of their picture.")
@click.option("--eyes", type=click.Choice(("microscope", "twin")), default="microscope", show_default=True,
              help="What operators look at: the scene, or the estimate, as late and as wrong.")  # fmt: skip
@click.option("--eyes-delay", type=MS, help="Until they see it; default: 0 at a microscope, else the chain's.")
@click.option("--operators", type=COUNT, default=40, show_default=True, help="Simulated operators, each in all cells.")
@click.option("--probes", type=Number(0, 1000, whole=True), default=2, show_default=True,
              help="Worlds of a cell in which a hand goes in sines, or is held still.")  # fmt: skip
@mode_option
@click.option(
    "--force-gain", type=Number(0.0, 1e6, above=True, unit="N/pN"), help="Of both hands; default: the chain's."
)
@click.option("--duration", type=SECONDS, help="When a trial is given up; default: 3 times the author's path.")
@click.option("--time-step", type=SECONDS, default=5e-4, show_default=True, help="Of the physics, at most.")
@click.option("--chunk", type=COUNT, help="Trials at once; default: 256 on a CPU, 16384 on a GPU. Changes no result.")
@seed_option
@device_option
def sweep(scene: Path, out: Path, operators: int, mode: str, force_gain: float | None, duration: float | None,
          time_step: float, chunk: int | None, seed: int, device: str | None, **asked: Any) -> None:  # fmt: skip
    """Let SIMULATED operators do the task of SCENE in every cell of a grid of delays and errors of perception.

    --delay, --depth-error, --lateral-error, --pose-error and --frame-rate are START:END:STEP, or numbers with commas
    between; a map is drawn over the first two that have several. Operators and their random numbers are the same in all
    cells. The same line goes on after whatever ended it.
    """
    from otwarp.device import pick_device
    from otwarp.operators.folder import Folder
    from otwarp.operators.perception.folder import run_sweep
    from otwarp.operators.perception.sweep import CHUNK_CPU, CHUNK_GPU, Sweep
    from otwarp.operators.study import OperatorStudy
    from otwarp.scene import Scene

    where = str(pick_device(device))
    there = Folder(out).asked()["chunk"] if chunk is None and (out / "study.json").exists() else None
    study = OperatorStudy(
        scene=Scene.load(scene), operators=operators, seed=seed, mode=mode, force_gain=force_gain, duration=duration,
        time_step=time_step,
    )  # fmt: skip
    axes, base = _perceptions(**asked)
    todo = Sweep(
        study=study, axes=axes, base=base, repeats=asked["probes"], depth_range=asked["depth_range"],
        chunk=chunk or there or (CHUNK_GPU if where.startswith("cuda") else CHUNK_CPU),
    )  # fmt: skip
    stop.begin()
    click.echo(f"{len(todo.cells)} cells, {todo.count:,} simulated trials", err=True)
    with parts("part", "parts of simulated trials") as progress:
        run_sweep(todo, out, device=where, progress=progress)
    click.echo(f"{operators} simulated operators are done in {len(todo.cells)} cells")
    click.echo(f"look at   otwarp operators show {out} --plot {out}.png")


def _perceptions(
    *, delay: tuple[float, ...], depth_error: tuple[float, ...], depth_range: float | None,
    lateral_error: tuple[float, ...], pose_error: tuple[float, ...], frame_rate: tuple[float, ...], correlation: float,
    unstamped: bool, eyes_delay: float | None, probes: int, **same: Any,
) -> tuple[dict[str, tuple[float, ...]], Any]:  # fmt: skip
    """Axes and common part of the cells, in the units of `Perception`."""
    from otwarp.operators.perception.errors import Perception

    axes = {
        "delay": tuple(1e-3 * ms for ms in delay),
        "depth_error": tuple(error * (depth_range or 1.0) for error in depth_error),
        "tilt_error": pose_error,
        "frame_rate": frame_rate,
        "lateral_error": lateral_error,
    }
    late = None if eyes_delay is None else 1e-3 * eyes_delay
    return axes, Perception(correlation=1e-3 * correlation, stamped=not unstamped, eyes_delay=late, **same)
