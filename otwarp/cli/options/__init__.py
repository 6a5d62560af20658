"""Options that several commands share: here those of many, beside it those of a few. Open this file first.

`bead`: of a sphere in its beam; `forces`: of `otwarp forces`. `live`: of a live session; `camera`: of a camera that
feeds one. `page`: of pages of recordings and drawn scenes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import click

from otwarp.cli.types import COUNT, SCENE, SECONDS, SEED, Number, OutputPath

scene_argument = click.argument("scene", type=SCENE)

device_option = click.option("--device", metavar="NAME", help="cpu, cuda:0, …; default: the best available.")

seed_option = click.option("--seed", type=SEED, default=0, show_default=True, help="Key of the random numbers.")

worlds_option = click.option(
    "--worlds",
    type=COUNT,
    default=1,
    show_default=True,
    help="Independent copies of the scene, each with its own noise.",
)

_time_step = click.option(
    "--time-step",
    type=SECONDS,
    metavar="SECONDS",
    help="Time step; default: the scene's, or chosen from its wanted accuracy.",
)

_integrator = click.option(
    "--integrator", metavar="NAME", help="eulerMaruyama, leimkuhlerMatthews, heun or exponential; default: the scene's."
)

_noise = click.option("--noise", metavar="NAME", help="gaussian, threePoint or uniform; default: the scene's.")

_precision = click.option(
    "--precision",
    type=click.Choice(["float32", "float64"]),
    default="float32",
    show_default=True,
    help="Of all numbers but the noise; float64 is slower, and for scenes of a few bodies without meshes.",
)

_fast_math = click.option(
    "--fast-math", is_flag=True, help="Approximate instructions on CUDA: faster, noise changes by 1e-6."
)

_allow_large_step = click.option(
    "--allow-large-step", is_flag=True, help="Take an explicit time step although its estimated errors exceed 10 %."
)

STEP_OPTIONS = ("time_step", "integrator", "noise", "precision", "fast_math", "allow_large_step")
"""What `step_options` asks for: fields of `otwarp.simulation.options.StepOptions`."""


def step_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command all that can be chosen about the step, as one mapping `options` for `StepOptions`."""

    @functools.wraps(command)
    def gathered(*arguments: Any, **given: Any) -> Any:
        chosen = {name: given.pop(name) for name in STEP_OPTIONS}
        return command(*arguments, options=chosen, **given)

    for option in (_noise, _integrator, _allow_large_step, _time_step, _fast_math, _precision):
        gathered = option(gathered)
    return gathered


mode_option = click.option(
    "--mode", type=click.Choice(["stable", "paper"]), default="stable", show_default=True, help="Haptic chain."
)

mesh_scale_option = click.option(
    "--scale",
    type=Number(0.0, 1e3, above=True),
    default=1e-6,
    show_default=True,
    metavar="METRES",
    help="Length of a unit of the mesh: 1e-6 for µm, 1e-3 for mm.",
)

force_option = click.option("--force", is_flag=True, help="Replace a file that is there.")

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object for a program, and no text.")
"""Standard output then has the object and nothing else; what is said meanwhile goes to standard error."""


def out_option(metavar: str, help: str, *, endings: tuple[str, ...] = ()) -> Callable[..., Any]:
    """`-o`, `--out`: the file, with one of the `endings` if there are any, or folder that a command is called for."""
    place = OutputPath(folder=metavar == "DIR", endings=endings)
    return click.option("-o", "--out", type=place, metavar=metavar, help=help)


def rate_option(name: str, low: float, high: float, default: float, help: str) -> Callable[..., Any]:
    """A rate from `low` to `high` [Hz]."""
    return click.option(name, type=Number(low, high, unit="Hz"), default=default, show_default=True, help=help)


def with_options(*options: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate a command with options, in this order."""

    def _decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return _decorate
