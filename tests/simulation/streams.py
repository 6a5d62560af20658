"""Cells in a flow that carries them out of their domain, which the tests of inlets share."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from otwarp.scene import Flow, Medium, Scene, Settings
from otwarp.simulation.simulation import Simulation
from tests.simulation.crowds import SOFT
from tests.simulation.setups import CELL, COLD, sphere_body

SPEED, STEP = 100.0, 1e-3
LOW, HIGH = (-10.0, 0.0, 0.0), (10.0, 0.0, 0.0)
INLET_LOW, INLET_HIGH = np.array((-9.0, -4.0, -3.0)), np.array((-6.0, 4.0, 3.0))
SETTINGS = Settings(
    time_step=STEP, domain_low=LOW, domain_high=HIGH, inlet_low=(-9.0, -4.0, -3.0), inlet_high=(-6.0, 4.0, 3.0)
)
COUNT = 8
DRIVERS: dict[str, dict[str, Any]] = {
    "solo": {"collides": False},
    "world": {"collides": True, "material": CELL},
    "soft": {"collides": True, "material": SOFT},
    "stiff": {"collides": True, "material": CELL},
}
"""Driver → what the cells are like; the last two are forms of the grid driver."""


def stream(driver: str, *, first: float = -8.0, spacing: float = 2.2, temperature: float = COLD, **changed) -> Scene:
    """Cells in a row in a uniform flow along x, and a robot that nobody carries back."""
    cells = tuple(
        sphere_body(f"C{i}", (first + spacing * i, 0.0, 0.0), kind="cell", trapped=False, **DRIVERS[driver])
        for i in range(COUNT)
    )
    away = sphere_body("Robot", (0.0, 300.0, 0.0), trapped=False, density=Medium().density)
    scene = Scene(
        medium=Medium(temperature=temperature),
        bodies=(*cells, away),
        flow=Flow(prim="/World/Flow", kind="uniform", speed=SPEED),
        settings=SETTINGS,
    )
    return dataclasses.replace(scene, **changed)


def simulate(scene: Scene, device: str, **more) -> Simulation:
    return Simulation(scene, device=device, allow_large_step=True, **{"seed": 5, **more})


def row(x: float, spacing: float = 2.2) -> np.ndarray:
    """(COUNT + 1, 3) cells one above the other at x, the robot far away [µm]."""
    places = np.array([(x, 0.0, spacing * i) for i in range(COUNT)] + [(0.0, 300.0, 0.0)])
    return places
