"""A bead and a robot on which all kinds of forces act, and kernels that ask for one of them."""

import dataclasses
from collections.abc import Callable

import numpy as np
import warp as wp

import otwarp as ot
from otwarp.kernels.bodies.bead import bead_constants_term
from otwarp.kernels.bodies.rigid import rigid_constants_term
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData
from otwarp.scene import Scene, Settings
from otwarp.simulation.model import Model
from otwarp.simulation.state import Control, State
from tests.kernels.samples import evaluate, on_device, quaternions
from tests.simulation.setups import harmonic, robot, sphere_body

ROUNDING = 2e-6
"""Relative error of sums of a few float32 numbers."""

PUSH = (0.3, -0.2, 0.5)
"""External force on the bead [pN]."""

HEAVY = 2500e-12
"""Density of both bodies [pN·s²/µm⁴]."""

CUTOFF = 1.5
"""Of the traps [µm]."""

FOCI = ((0.0, 0.0, 0.0), (1.2, 0.0, 0.4), (-0.5, 1.0, 0.0))
"""Of up to three traps [µm]."""


@ot.force(strength="pN·µm")
def turning(body: ot.ForceInput, strength: float) -> ot.Wrench:
    return ot.Wrench(wp.vec3(0.0), wp.vec3(0.0, 0.0, strength))


@ot.force(acts_on="spheres", per_radius="pN/µm")
def by_size(body: ot.ForceInput, per_radius: float):
    return wp.vec3(0.0, 0.0, per_radius * body.radius * (1.0 + body.time))


def scene(traps: int = 0, **bead) -> Scene:
    """Body 0 is the bead, body 1 the robot."""
    lone = dataclasses.replace(sphere_body("Bead", density=HEAVY, **bead), forces={"external_force": PUSH})
    return Scene(
        bodies=(lone, dataclasses.replace(robot("Robot", (0.0, 20.0, 0.0)), density=HEAVY)),
        traps=tuple(harmonic(f"T{i}", focus, cutoff=CUTOFF) for i, focus in enumerate(FOCI[:traps])),
        settings=Settings(gravity=True, brownian=False, time_step=1e-4),
    )


def places(n: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) points around the traps [µm], and (n, 4) orientations."""
    rng = np.random.default_rng(5)
    return (1.2 * rng.normal(size=(n, 3))).astype(np.float32), quaternions(rng, n)


def on_sphere(model: Model, make: Callable[[Features], wp.Function], kind: type = wp.vec3) -> np.ndarray:
    """What `make(features)` gives for the bead at `places`."""
    constants_of, term = bead_constants_term(model.features), make(model.features)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(
        model: ModelData, control: ControlData, state: StateData, position: wp.array(dtype=wp.vec3),
        out: wp.array(dtype=kind),
    ):  # fmt: skip
        i = wp.tid()
        bead = constants_of(model, control, 0, 0)
        out[i] = term(model, control, state, bead, 0, 0, position[i], wp.float64(0.0))

    position, _ = places()
    inputs = [model.data, Control.start(model).data(), State.start(model).data()]
    device = str(model.device)
    return evaluate(probe, len(position), [*inputs, *on_device(device, (position, wp.vec3))], [kind], device)[0]


def on_body(model: Model, make: Callable[[Features], wp.Function]) -> tuple[np.ndarray, np.ndarray]:
    """Force and torque that `make(features)` gives for the robot at `places`."""
    constants_of, term = rigid_constants_term(model.features), make(model.features)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(
        model: ModelData, control: ControlData, state: StateData, position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat), force: wp.array(dtype=wp.vec3), torque: wp.array(dtype=wp.vec3),
    ):  # fmt: skip
        i = wp.tid()
        body = constants_of(model, control, 0, 1)
        load = term(model, control, state, body, 0, 1, Pose(position[i], rotation[i]), wp.float64(0.0))
        force[i] = load.force
        torque[i] = load.torque

    position, rotation = places()
    inputs = [model.data, Control.start(model).data(), State.start(model).data()]
    device = str(model.device)
    inputs += on_device(device, (position, wp.vec3), (rotation, wp.quat))
    force, torque = evaluate(probe, len(position), inputs, [wp.vec3, wp.vec3], device)
    return force, torque
