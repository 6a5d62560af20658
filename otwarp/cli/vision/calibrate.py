"""`otwarp vision calibrate`: what pixels, planes and depths of a microscope are in µm."""

from __future__ import annotations

import math
from pathlib import Path

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option, out_option, scene_argument, seed_option
from otwarp.cli.types import Number

SIDE = 10.0
"""Of the images [µm]."""


@click.command()
@scene_argument
@click.option("--pitch", type=Number(0.0, 1000.0, above=True, unit="µm"), default=2.0, show_default=True,
              help="Of the grid of dots [µm].")  # fmt: skip
@click.option("--angle", type=Number(-40.0, 40.0, unit="degrees"), default=3.0, show_default=True,
              help="By which grid and stage are turned against the camera [degrees].")  # fmt: skip
@click.option("--trap-height", type=Number(-1.0, 1.0, unit="µm"), default=0.4, show_default=True,
              help="Of the trapped bead above the camera's focal plane [µm].")  # fmt: skip
@out_option("FILE", "Gets the calibration, versioned JSON; default: calibration.json.")
@seed_option
@device_option
def calibrate(
    scene: Path, pitch: float, angle: float, trap_height: float, out: Path | None, seed: int, device: str | None
) -> None:
    """Calibrate the microscope of SCENE on synthetic targets that it renders itself.

    A grid of known pitch and a stuck bead moved by known steps give the size of a pixel, a sweep of the focus over a
    trapped bead the height of the trap plane, stuck beads at known heights the scale of depth. Each is measured from
    images with the sensor's noise; beside it stands what the target was made with.
    """
    from otwarp.scene import Scene
    from otwarp.vision.calibration import Bench
    from otwarp.vision.calibration import calibrate as look
    from otwarp.vision.rendering import Rendering
    from otwarp.vision.view import microscope_of, sensor_of

    seen = Scene.load(scene)
    microscope, sensor = microscope_of(seen), sensor_of(seen)
    width = 2 * math.ceil(0.5 * SIDE / microscope.pixel)
    bench = Bench(
        microscope=microscope, sensor=sensor, rendering=Rendering(rings=2, margin=3.0), width=width, seed=seed
    )
    bench.check_pitch(pitch, "--pitch")
    stop.begin()

    def say(what: str) -> None:
        stop.check()
        click.echo(f"otwarp: {what}", err=True)

    found = look(bench, pitch=pitch, angle=angle, trap_height=trap_height, device=device, say=say)
    file = found.save(out or Path("calibration.json"))
    for name, result in found.results.items():
        authored = "" if result.authored is None else f"; made with {result.authored:.6g}"
        click.echo(f"{name}: {result.value:.6g} {result.unit}, 95 % {result.low:.6g} to {result.high:.6g}{authored}")
    click.echo(f"wrote {file}")
