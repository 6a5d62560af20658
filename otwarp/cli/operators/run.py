"""`otwarp operators run`: simulated operators at a scene's task, with and without haptics."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option, mode_option, scene_argument, seed_option
from otwarp.cli.progress import parts
from otwarp.cli.types import COUNT, SECONDS, Number, OutputPath


@click.command()
@scene_argument
@click.option("-o", "--out", type=OutputPath(folder=True), metavar="DIR", default="out/operators", show_default=True,
              help="Folder of the study.")  # fmt: skip
@click.option("--operators", type=COUNT, default=200, show_default=True, help="Simulated operators.")
@click.option("--no-response", is_flag=True, help="Also run haptics without the delayed response: the arm yields only.")
@click.option("--sobol", type=COUNT, metavar="N", help="Sobol indices of the parameters from N rows, a power of 2; "
              "N·(parameters + 2) operators in place of --operators.")  # fmt: skip
@mode_option
@click.option(
    "--force-gain", type=Number(0.0, 1e6, unit="N/pN"), metavar="N/pN", help="Of both hands; default: the chain's."
)
@click.option("--motion-gain", type=Number(0.0, 1e9, above=True, unit="µm/m"), metavar="µm/m",
              help="Of both hands; default: the least that brings the path into the device's workspace.")  # fmt: skip
@click.option(
    "--duration", type=SECONDS, metavar="SECONDS", help="When a trial is given up; default: 3 times the author's path."
)
@click.option(
    "--press",
    type=Number(-100.0, 100.0, unit="µm"),
    default=0.0,
    show_default=True,
    metavar="µm",
    help="How much farther towards the cell every hand aims than the author's path, with haptics and without.",
)
@click.option(
    "--time-step", type=SECONDS, metavar="SECONDS", default=5e-4, show_default=True, help="Of the physics, at most."
)
@click.option("--frame-rate", type=Number(1.0, 20_000.0, unit="Hz"), metavar="Hz", default=120.0, show_default=True,
              help="Pictures per second, for eyes and servo.")  # fmt: skip
@click.option("--chunk", type=COUNT, help="Operators at once; default: 32 on a CPU, 2048 on a GPU. Changes no result.")
@seed_option
@device_option
def run(
    scene: Path,
    out: Path,
    operators: int,
    no_response: bool,
    sobol: int | None,
    mode: str,
    force_gain: float | None,
    motion_gain: float | None,
    duration: float | None,
    press: float,
    time_step: float,
    frame_rate: float,
    chunk: int | None,
    seed: int,
    device: str | None,
) -> None:
    """Let SIMULATED operators do the task of SCENE, each with and without haptics and the same random numbers.

    The same line goes on after whatever ended it: chunks that are whole are kept.
    """
    from otwarp.scene import Scene

    loaded = Scene.load(scene)  # before Warp is, which takes longer
    from otwarp.device import pick_device
    from otwarp.operators.folder import Folder, run_study
    from otwarp.operators.study import CHUNK_CPU, CHUNK_GPU, OperatorStudy

    where = str(pick_device(device))
    there = Folder(out).asked()["chunk"] if chunk is None and (out / "study.json").exists() else None
    study = OperatorStudy(
        scene=loaded,
        operators=operators,
        seed=seed,
        mode=mode,
        force_gain=force_gain,
        motion_gain=motion_gain,
        duration=duration,
        press=press,
        conditions=("without", "with", "no response") if no_response else ("without", "with"),
        sobol=sobol or 0,
        chunk=chunk or there or (CHUNK_GPU if where.startswith("cuda") else CHUNK_CPU),
        frame_rate=frame_rate,
        time_step=time_step,
    )
    stop.begin()
    with parts("chunk", "chunks of simulated operators") as progress:
        run_study(study, out, device=where, progress=progress)
    click.echo(f"{study.count} simulated operators are done")
    click.echo(f"look at   otwarp operators show {out} --plot {out}.png")
