"""Case b, many soft Brownian spheres that touch: the workload that codes for many particles are compared by.

Spheres of radius a at volume fraction 0.15 with soft repulsion, in random order, in steps of D·dt = 10⁻⁴·(2a)². They
are a cube in open space; Hertz repulsion with a barrier of 29 k_B T at the deepest overlap takes the place of
Weeks–Chandler–Andersen. No scene is read or built for so many: arrays of one small scene are repeated.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.kernels.step import make_step
from otwarp.scene import Body, Material, Medium, Scene, Settings, Sphere
from otwarp.simulation.drivers.grid_stepper import GridStepper
from otwarp.simulation.drivers.stepping import StepperParts
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.state import Control, Readout, State
from otwarp.units import BOLTZMANN
from otwarp.warp_internals import alike, fields

RADIUS = 1.0
FRACTION = 0.15
DIFFUSED = 1e-4
"""D·dt over the squared diameter."""
SURFACE = Material(youngs_modulus=3.0, poisson_ratio=0.4)
SEEDED = 30
"""Bodies of the scene whose arrays are repeated: enough for the grid driver."""


def time_step() -> float:
    """The step [s] that follows from `DIFFUSED`."""
    medium = Medium()
    diffusion = BOLTZMANN * medium.temperature / (6.0 * np.pi * medium.viscosity * RADIUS)
    return DIFFUSED * (2.0 * RADIUS) ** 2 / diffusion


def start_places(count: int, seed: int = 5) -> np.ndarray:
    """(count, 3) float32 places in random order, nowhere deeper in each other than 0.4 radii [µm]."""
    side = int(np.ceil(round(count ** (1.0 / 3.0), 6)))
    length = (count * 4.0 / 3.0 * np.pi * RADIUS**3 / FRACTION) ** (1.0 / 3.0)
    spacing = length / side
    rng = np.random.default_rng(seed)
    chosen = rng.permutation(side**3)[:count]
    lattice = np.stack(np.unravel_index(chosen, (side,) * 3), axis=1)
    free = max(0.0, spacing - 1.6 * RADIUS)
    return ((lattice + 0.5 - 0.5 * side) * spacing + rng.uniform(-0.5, 0.5, (count, 3)) * free).astype(np.float32)


@dataclass(frozen=True)
class Spheres:
    """The workload in numbers: spheres repel by hardness·overlap^{3/2} and move by mobility·force + kick·ξ in a step.

    Attributes:
        start: (count, 3) float32 places [µm].
        diameter: [µm].
        hardness: 4/3·E*·√R [pN/µm^{3/2}].
        mobility: dt/γ [µm/pN].
        kick: √(2 D dt) [µm].
    """

    start: np.ndarray
    diameter: float
    hardness: float
    mobility: float
    kick: float

    @property
    def thermal(self) -> float:
        """k_B T [pN µm]."""
        return 0.5 * self.kick**2 / self.mobility

    def energy(self, distance: np.ndarray) -> np.ndarray:
        """Of pairs at a distance [pN µm]."""
        return 0.4 * self.hardness * np.maximum(self.diameter - distance, 0.0) ** 2.5


def spheres(count: int) -> Spheres:
    """So many of them, for a code that is not otwarp's."""
    reduced = SURFACE.youngs_modulus / (2.0 * (1.0 - SURFACE.poisson_ratio**2))
    return Spheres(
        start=start_places(count),
        diameter=2.0 * RADIUS,
        hardness=4.0 / 3.0 * math.sqrt(0.5 * RADIUS) * reduced,
        mobility=time_step() / (6.0 * math.pi * Medium().viscosity * RADIUS),
        kick=2.0 * RADIUS * math.sqrt(2.0 * DIFFUSED),
    )


def repeated(data: Any, count: int, device: wp.Device) -> Any:
    """A struct of per-body arrays of `SEEDED` equal bodies, for `count` of them."""
    found = fields(data)
    for name, value in found.items():
        if isinstance(value, wp.array) and len(value) in (SEEDED, SEEDED + 1) and value.ndim == 1:
            rows = value.numpy()
            # start offsets go on in steps, and so does the number of the body
            steps = name.endswith("start") or name == "body"
            rows = rows[0] + (rows[1] - rows[0]) * np.arange(count + len(value) - SEEDED) if steps else rows[:1]
            rows = rows if steps else np.broadcast_to(rows, (count, *rows.shape[1:]))
            found[name] = wp.array(np.ascontiguousarray(rows), dtype=value.dtype, device=device)
    return alike(data, **found)


def many_body_model(count: int, device: wp.Device, fast_math: bool) -> Model:
    """A model of `count` equal soft spheres; its scene holds the first few."""
    ball = Sphere(prim="/World/S", radius=RADIUS, trapped=False)
    bodies = tuple(
        Body(prim=f"/World/B{i}", position=(3.0 * i, 0.0, 0.0), spheres=(ball,), material=SURFACE)
        for i in range(SEEDED)
    )
    scene = Scene(bodies=bodies, settings=Settings(time_step=time_step()))
    model = Model.build(scene, device=device, options=StepOptions(fast_math=fast_math))
    parts = {name: repeated(getattr(model.data, name), count, device) for name in ("body", "contact")}
    data = alike(model.data, bodies=count, **parts)
    return dataclasses.replace(model, data=data, features=dataclasses.replace(model.features, bodies=count))


class ManySpheres:
    """`count` spheres ready to be stepped."""

    def __init__(self, count: int, device: wp.Device, *, fast_math: bool = False):
        self.count, self.device = count, device
        self.model = many_body_model(count, device, fast_math)
        self.state = State(
            position=wp.array(start_places(count)[None], dtype=wp.vec3, device=device),
            orientation=wp.zeros((1, 0), dtype=wp.quat, device=device),
            trap_position=wp.zeros((1, 0), dtype=wp.vec3, device=device),
            image=wp.zeros((1, 0), dtype=wp.vec3i, device=device),
        )
        empty = vars(Readout.empty(self.model))
        per_body = {"contact_force", "contact_load", "fault", "fault_step"}
        sized = {n: wp.zeros((1, count), dtype=empty[n].dtype, device=device) for n in per_body}
        self.readout = Readout(**(empty | sized))
        control = Control.start(self.model)
        step = make_step(self.model.features)
        self.stepper = GridStepper(StepperParts(step, self.model, self.state, control, self.readout))

    def step(self, steps: int) -> None:
        """Take steps."""
        self.stepper.advance(self.state.step, steps)
        self.state.step += steps
