"""`otwarp run`: simulate a scene and record it."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import click
from click.core import ParameterSource

from otwarp.cli import stop
from otwarp.cli.options import (
    STEP_OPTIONS,
    device_option,
    json_option,
    out_option,
    scene_argument,
    seed_option,
    step_options,
    worlds_option,
)
from otwarp.cli.output import json_text
from otwarp.cli.types import COUNT, FILE, POSITIVE, SECONDS
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.scene import Scene


@click.command()
@scene_argument
@out_option("DIR", "Folder for the results; default: out/SCENE.")
@worlds_option
@seed_option
@click.option("--duration", type=SECONDS, metavar="SECONDS", help="Simulated time; default: the scene's.")
@click.option("--fps", type=POSITIVE, help="Recorded frames per simulated second; default: the scene's.")
@click.option(
    "--trap-speed", type=POSITIVE, default=1.0, show_default=True, help="Play the traps' time samples this much faster."
)
@click.option("--forces", is_flag=True, help="Write force arrows into the USD recording.")
@click.option("--record-worlds", type=COUNT, metavar="N", help="Worlds kept in run.nc; default: all.")
@click.option("--checkpoint", type=FILE, metavar="FILE", help="Save the end of the run here.")
@click.option("--resume", type=FILE, metavar="FILE", help="Continue from a checkpoint.")
@step_options
@device_option
@json_option
@click.pass_context
def run(
    context: click.Context,
    scene: Path,
    out: Path | None,
    worlds: int,
    seed: int,
    duration: float | None,
    fps: float | None,
    trap_speed: float,
    forces: bool,
    record_worlds: int | None,
    checkpoint: Path | None,
    resume: Path | None,
    options: dict[str, Any],
    device: str | None,
    as_json: bool,
) -> None:
    """Simulate SCENE and record it.

    The results are run.usda (opens in usdview, Blender, Isaac Sim), run.nc (netCDF for Python, MATLAB, …),
    summary.json and figure.png.
    """
    from otwarp.record import record_run
    from otwarp.simulation.options import StepOptions

    if resume is not None:
        _refuse_with_resume(context)
    loaded = _load(scene, duration, trap_speed)
    folder = out or Path("out") / scene.stem
    stop.begin()
    with _kept(folder), _progress_bar(loaded.settings.duration) as progress:
        summary = record_run(
            loaded,
            folder,
            worlds=worlds,
            seed=seed,
            device=device,
            frames_per_second=fps,
            recorded_worlds=record_worlds,
            force_arrows=forces,
            checkpoint=checkpoint,
            resume=resume,
            options=StepOptions(**options),
            progress=progress,
        )
    if as_json:
        click.echo(json_text(summary))
    else:
        _print(summary, folder)


@contextmanager
def _kept(folder: Path) -> Iterator[None]:
    """Say what is kept of a run that is interrupted."""
    from otwarp.record.folder import SUMMARY, early_end

    def when() -> int | None:
        """When the summary was last written [ns]."""
        return file.stat().st_mtime_ns if file.exists() else None

    file = folder / SUMMARY
    before = when()
    try:
        yield
    except KeyboardInterrupt:
        if when() != before and (said := early_end(folder)):
            click.echo(f"otwarp: {said}; its files are whole", err=True)
        raise


def _load(file: Path, duration: float | None, trap_speed: float) -> Scene:
    """The scene, for `duration` seconds if given, with its traps played that much faster."""
    from otwarp.scene import Scene

    # the traps are sped up after loading, so the samples must cover the stretched time
    scene = Scene.load(file, duration=None if duration is None else duration * trap_speed)
    return scene.with_trap_speed(trap_speed) if trap_speed != 1.0 else scene


def _refuse_with_resume(context: click.Context) -> None:
    """A checkpoint brings its own worlds, seed and time step: other ones would be ignored without a word."""
    for option in ("worlds", "seed", *STEP_OPTIONS):
        if context.get_parameter_source(option) == ParameterSource.COMMANDLINE:
            name, value = f"--{option.replace('_', '-')}", context.params[option]
            raise InputError(f"{name} is {value}; allowed with --resume: that of the checkpoint, so leave it out")


@contextmanager
def _saying(say: Callable[[str], None]) -> Iterator[None]:
    """Say what otwarp logs."""
    log, handler = logging.getLogger("otwarp"), logging.Handler()
    handler.emit = lambda record: say(record.getMessage())
    kept = log.level
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.setLevel(kept)
        log.removeHandler(handler)


@contextmanager
def _progress_bar(duration: float) -> Iterator[Callable[[float, float], None]]:
    """A bar with the real-time factor on standard error, if that is a terminal; at every frame, end on SIGTERM.

    What takes long before the first frame is said in a line: kernels that are compiled.
    """
    if not sys.stderr.isatty():
        with _saying(lambda line: click.echo(f"otwarp: {line}", err=True)):
            yield lambda simulated, wall: stop.check()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("simulating"),
        BarColumn(),
        TextColumn("{task.completed:.2f}/{task.total:.2f} s"),
        TextColumn("{task.fields[speed]}"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True, highlight=False)
    with (
        Progress(*columns, console=console, transient=True) as bar,
        _saying(lambda line: console.print(line, markup=False)),
    ):
        task = bar.add_task("run", total=duration, speed="")
        begins: list[float] = []

        def update(simulated: float, wall: float) -> None:
            """Move the bar to the simulated time."""
            stop.check()
            if not begins:
                # a resumed run starts late: what came before took none of this wall time
                begins.append(simulated)
                bar.reset(
                    task, completed=cast("int", simulated), total=duration, speed=""
                )  # rich counts floats as well
                return
            bar.update(task, completed=simulated, speed=f"{(simulated - begins[0]) / max(wall, 1e-9):.1f}× real time")

        yield update


def _print(summary: dict[str, Any], folder: Path) -> None:
    click.echo(summary["text"])
    click.echo(f"look at   {folder / 'figure.png'}")
    click.echo(f"open      {folder / 'run.usda'}   (usdview, Blender, Isaac Sim)")
    click.echo(f"analyse   {folder / 'run.nc'}   (xarray, MATLAB)")
    click.echo(f"summary   {folder / 'summary.json'}")
