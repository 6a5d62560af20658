"""otwarp: the digital twin of an optical-tweezers microrobotics lab, on NVIDIA Warp and USD.

    import otwarp as ot
    scene = ot.Scene.load("scenes/cell_delivery.usda")
    sim = ot.Simulation(scene, worlds=256, seed=7)
    sim.run(0.5)
    sim.state.position.numpy()       # (256, bodies, 3) µm

Names are loaded when first used, so that `import otwarp` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from otwarp.errors import InputError, SimulationError
    from otwarp.kernels.core.types import ForceInput, Wrench
    from otwarp.scene import Scene
    from otwarp.simulation.packing.forces import force
    from otwarp.simulation.simulation import Simulation

__version__ = "0.1.0"

_HOMES = {
    "InputError": "otwarp.errors",
    "SimulationError": "otwarp.errors",
    "Scene": "otwarp.scene",
    "Simulation": "otwarp.simulation.simulation",
    "ForceInput": "otwarp.kernels.core.types",
    "Wrench": "otwarp.kernels.core.types",
    "force": "otwarp.simulation.packing.forces",
}

__all__ = [
    "ForceInput",
    "InputError",
    "Scene",
    "Simulation",
    "SimulationError",
    "Wrench",
    "__version__",
    "force",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'otwarp' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
