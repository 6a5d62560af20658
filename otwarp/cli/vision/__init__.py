"""`otwarp vision`: what the microscope of a scene sees; one module for every command.

`render`: images in focal planes, by `otwarp.vision` (open `pictures` there). `dataset`: many of them with their labels,
by `otwarp.vision.datasets`. `calibrate`: pixels, planes and depths in µm, by `otwarp.vision.calibration`. `train`,
`evaluate`, `export`: networks that tell from an image how a robot lies, by `otwarp.vision.networks`.
`find`, `track`: robots in a frame, a body in the frames of a run, by `otwarp.vision.tracking`.
"""

from __future__ import annotations

import click

from otwarp.cli.lazy import LazyGroup

COMMANDS = {
    "render": "Draw what the scene's microscope sees, in one or more focal planes.",
    "calibrate": "Measure pixels, trap plane and depths of a scene's microscope on synthetic targets.",
    "dataset": "Render a data set of robots with exact labels, or go on with it.",
    "train": "Train a network on a data set, or go on with it.",
    "evaluate": "Say how good a network is, how sure, and what images hold.",
    "export": "Write a network as ONNX.",
    "find": "Find the robots in an image, and say how each lies.",
    "track": "Follow a body of a recorded run through what its camera sees.",
}
"""Commands and their one-line help; each lives in the module of its name and is imported when called."""


@click.group(cls=LazyGroup, package=__name__, rows=COMMANDS)
def vision() -> None:
    """Images of transparent robots and cells, computed from waves."""
