"""otwarp: the digital twin of an optical-tweezers microrobotics lab, on NVIDIA Warp and USD.

    import otwarp as ot
    scene = ot.Scene.load("scenes/cell_delivery.usda")
    sim = ot.Simulation(scene, worlds=256, seed=7)
    sim.run(0.5)
    sim.state.position.numpy()       # (256, bodies, 3) µm

Names are loaded when first used, so that `import otwarp` costs nothing. The rooms, each with a floor plan in its own
docstring (docs/architecture.md shows who may import whom):

    scene          what a USD stage says; read, checked, written, recorded, drawn
    simulation     a model of a scene, and the one object that steps it (open `simulation/simulation.py` first)
    kernels        physics as Warp functions, composed into the step
    optics         beams, Mie scattering, force tables, fits
    hydrodynamics  mobilities of bodies, in float64
    laws           what several rooms evaluate, each in its own way
    studies        trials of a scene at many points, with intervals
    envs           environments of Gymnasium: tasks in scenes, thousands at once
    record         frames of a run to files
    vision         what the microscope of a scene sees
    analysis       what a run or a study tells: calibrations, spectra, work, escapes
    preview        pictures and movies of them
    haptics        what operators feel, a thousand times a second
    view           recordings played back in the browser
    teleop         live sessions: page, operators, budget, recording
    perception     images that say where the bodies of a session are
    ros            the same session as the topics of ROS 1 and ROS 2
    bench          what a user measures on his machine
    reproduce      the paper's tables and figures, computed anew and set beside the published ones
    cli            all of this from the command line

Files that every room may import: `errors` (what a user meets), `units` (internal units and constants), `files` (whole
or not at all), `processes` (several, side by side), `shipped` (scenes, studies and data sets by name), `triangles`
(meshes as they are given), `cache` (what took long to compute, on disk), `lazy` (names loaded when used), `device`
(Warp, started and chosen), `warp_internals` (all that counts on more of Warp than it promises).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp import analysis
    from otwarp.errors import InputError, PlausibilityWarning, SimulationError
    from otwarp.kernels.core.types import ForceInput, WorldNow, Wrench
    from otwarp.scene import Scene
    from otwarp.simulation.ends import end, escaped, reached, strayed, timed_out
    from otwarp.simulation.options import StepOptions
    from otwarp.simulation.sharded import ShardedSimulation
    from otwarp.simulation.simulation import Simulation
    from otwarp.simulation.user_forces import force
    from otwarp.studies import (
        EscapeStudy,
        Scatter,
        Study,
        budget,
        contour,
        delivered,
        distance,
        energy,
        first_passage,
        grid,
        half_width,
        largest,
        lost,
        normal,
        observable,
        order,
        random,
        sobol,
        trapped,
        trials,
        values,
    )

__version__: str
"""Of the installed package; from the last tag."""

__all__ = [
    "EscapeStudy",
    "ForceInput",
    "InputError",
    "PlausibilityWarning",
    "Scatter",
    "Scene",
    "ShardedSimulation",
    "Simulation",
    "SimulationError",
    "StepOptions",
    "Study",
    "WorldNow",
    "Wrench",
    "__version__",
    "analysis",
    "budget",
    "contour",
    "delivered",
    "distance",
    "end",
    "energy",
    "escaped",
    "first_passage",
    "force",
    "grid",
    "half_width",
    "largest",
    "lost",
    "normal",
    "observable",
    "order",
    "random",
    "reached",
    "sobol",
    "strayed",
    "timed_out",
    "trapped",
    "trials",
    "values",
]

_named, __dir__ = lazy_names(
    __name__,
    {
        "errors": ("InputError", "PlausibilityWarning", "SimulationError"),
        "kernels.core.types": ("ForceInput", "WorldNow", "Wrench"),
        "scene": ("Scene",),
        "simulation.ends": ("end", "escaped", "reached", "strayed", "timed_out"),
        "simulation.options": ("StepOptions",),
        "simulation.sharded": ("ShardedSimulation",),
        "simulation.simulation": ("Simulation",),
        "simulation.user_forces": ("force",),
        "studies": (
            "EscapeStudy",
            "Scatter",
            "Study",
            "budget",
            "contour",
            "delivered",
            "distance",
            "energy",
            "first_passage",
            "grid",
            "half_width",
            "largest",
            "lost",
            "normal",
            "observable",
            "order",
            "random",
            "sobol",
            "trapped",
            "trials",
            "values",
        ),
    },
    rooms=("analysis",),
)


def __getattr__(name: str) -> Any:
    """A name from its file, or the version that is installed, which is looked up when it is asked for."""
    return _version() if name == "__version__" else _named(name)


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("otwarp")
    except PackageNotFoundError:  # a checkout on the path, which nobody has installed
        return "0+unknown"
