"""`otwarp haptics check`: what this machine can do for a hand."""

from __future__ import annotations

import dataclasses
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli import stop
from otwarp.cli.options import json_option, rate_option
from otwarp.cli.output import json_text, tables_console
from otwarp.cli.types import SCENE, SECONDS
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.haptics.check import Check
    from otwarp.scene import Scene


@click.command()
@click.option(
    "--seconds", type=SECONDS, default=3.0, show_default=True, help="Length of each measurement with a clock."
)
@click.option(
    "--device",
    metavar="DEVICE",
    help="Device for the latency, as after --left; default: a virtual one. A real one is not armed and feels nothing.",
)
@rate_option("--rate", 1.0, 20_000.0, 1000.0, "Cycles of the servo per second.")
@click.option("--width/--no-width", default=True, help="Compute the table of Z-widths (some 15 s).")
@click.option("--page/--no-page", default=True, show_default=True, help="Measure the latency from state to page.")
@click.option("--browser", metavar="FILE", help="Browser to measure it with; default: a Chromium, if there is one.")
@click.option("--scene", type=SCENE, help="Also say how fast this scene runs here.")
@click.option("--scene-device", metavar="NAME", help="Where it runs: cpu, cuda:0, …; default: the best available.")
@json_option
def check(
    seconds: float,
    device: str | None,
    rate: float,
    width: bool,
    page: bool,
    browser: str | None,
    scene: Path | None,
    scene_device: str | None,
    as_json: bool,
) -> None:
    """Find devices; measure loop jitter, latency and cost here; say what is limited, and why.

    Nothing that can push is armed.
    """
    from otwarp.haptics.check import run_check
    from otwarp.haptics.check.timing import VIRTUAL
    from otwarp.teleop.operators.servo import compile_laws

    # what is bad is reported before anything is measured
    measured = None if scene is None else _load(scene)
    if scene_device is not None:
        from otwarp.device import pick_device

        pick_device(scene_device)
    if browser is not None and shutil.which(browser) is None:
        raise InputError(f"--browser is {browser!r}; allowed: a program that is there")
    stop.begin()
    with _progress(as_json) as say:
        found = run_check(
            seconds, device=device or VIRTUAL, rate=rate, width=width, progress=say, compiler=compile_laws
        )
        if page:
            found = dataclasses.replace(found, page=_page_latency(seconds, browser, say))
        if measured is not None:
            found = dataclasses.replace(found, scene=_scene_cost(measured, scene_device, say))
    if as_json:
        click.echo(json_text(found.json()))
    else:
        _print(found)


def _page_latency(seconds: float, browser: str | None, say: Callable[[str], None]) -> dict[str, Any]:
    """How long a state takes to the page; without viser, that it is needed."""
    from otwarp.teleop.page.measure import measure_page

    say("latency from state to page (a browser without a window takes some seconds to load it)")
    try:
        return dataclasses.asdict(measure_page(seconds, browser=browser))
    except InputError as error:
        return {"trouble": str(error)}


def _load(file: Path) -> Scene:
    """A scene, by modules that are not imported without need of one."""
    from otwarp.scene import Scene

    return Scene.load(file)


def _scene_cost(scene: Scene, device: str | None, say: Callable[[str], None]) -> dict[str, Any]:
    """How fast a scene runs, read out as in a session."""
    from otwarp.teleop.budget.report import FRAME_RATE, measure_scene

    say(f"real-time factor of {scene.file} (new kernels are compiled first)")
    cost = measure_scene(scene, device=device)
    return {
        "file": str(scene.file),
        "bodies": cost.bodies,
        "time_step": cost.time_step,
        "frames_per_second": FRAME_RATE,
        "step": cost.step,
        "frame": cost.frame,
        "real_time_factor": cost.speed(1.0),
        "load": cost.load(1.0),
    }


@contextmanager
def _progress(as_json: bool) -> Iterator[Callable[[str], None]]:
    """What is being done, on standard error; ends on SIGTERM."""
    if not sys.stderr.isatty():

        def log(line: str) -> None:
            """A line for a log, none where a program reads."""
            stop.check()
            if not as_json:
                click.echo(f"{line} …", err=True)

        yield log
        return
    from rich.console import Console

    with Console(stderr=True).status("…") as status:

        def show(line: str) -> None:
            """The present part beside a spinner."""
            stop.check()
            status.update(line)

        yield show


def _page_text(page: dict[str, Any]) -> str:
    """The page's latency in a line or two."""
    if "trouble" in page:
        return f"state to page: {page['trouble']}"
    middle, worst = (1e3 * t for t in page["applied"])
    lines = [f"state to page: handed to the browsers {middle:.3g} ms after it was published (at most {worst:.3g} ms)"]
    if page["delay"]:
        middle, worst = (1e3 * t for t in page["delay"])
        lines.append(
            f"               answered by {page['browser']} after {middle:.3g} ms (at most {worst:.3g} ms in "
            f"{page['answers']}), the way back included"
        )
    else:
        lines.append(f"               browser: {page['browser']}")
    return "\n".join(lines)


def _print(found: Check) -> None:
    from otwarp.cli.haptics.tables import check_tables

    console = tables_console(140)
    console.print(found.system, markup=False)
    for table in check_tables(found):
        console.print(table)
    console.print(f"force law: {found.law}", markup=False)
    for line in found.trouble:
        console.print(line, markup=False)
    if found.page is not None:
        click.echo(_page_text(found.page))
    scene = found.scene
    if scene is not None:
        console.print(
            f"{scene['file']}: {scene['real_time_factor']:.3g}× real time on one core ({scene['bodies']} bodies, time "
            f"step {1e6 * scene['time_step']:.4g} µs, {scene['frames_per_second']:g} frames/s read out); real time "
            f"takes {100.0 * scene['load']:.3g} % of it",
            markup=False,
        )
