"""otwarp: the digital twin of an optical-tweezers microrobotics lab, on NVIDIA Warp and USD.

    import otwarp as ot
    scene = ot.Scene.load("scenes/cell_delivery.usda")
    sim = ot.Simulation(scene, worlds=256, seed=7)
    sim.run(0.5)
    sim.state.position.numpy()       # (256, bodies, 3) µm

Names are loaded when first used, so that `import otwarp` costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.errors import InputError, PlausibilityWarning, SimulationError
    from otwarp.kernels.core.types import ForceInput, WorldNow, Wrench
    from otwarp.scene import Scene
    from otwarp.simulation.ends import end, escaped, reached, strayed, timed_out
    from otwarp.simulation.options import StepOptions
    from otwarp.simulation.sharded import ShardedSimulation
    from otwarp.simulation.simulation import Simulation
    from otwarp.simulation.user_forces import force

__version__ = "0.1.0"

__all__ = [
    "ForceInput",
    "InputError",
    "PlausibilityWarning",
    "Scene",
    "ShardedSimulation",
    "Simulation",
    "SimulationError",
    "StepOptions",
    "WorldNow",
    "Wrench",
    "__version__",
    "end",
    "escaped",
    "force",
    "reached",
    "strayed",
    "timed_out",
]

__getattr__, __dir__ = lazy_names(
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
    },
)
