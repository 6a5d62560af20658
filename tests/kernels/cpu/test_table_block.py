"""Forces of tables in the vector registers of a CPU against the same forces one by one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

from otwarp import Simulation
from otwarp.kernels.optics.trap_wrench import blocked_table
from otwarp.kernels.step import make_step
from otwarp.scene import Scene, Settings, Track, Trap
from otwarp.simulation.drivers.stepping import FusedStepper, StepperParts
from tests.simulation.setups import robot

WORLDS = 11
STEPS = 40
TIME_STEP = 1e-5

AGREEMENT = 5e-6
"""Positions [µm] and quaternions [1]: some roundings of float32 at 10 µm, where half a step of drift is 1e-3."""

PLACES = ((-4.2, 0.1, 1.1), (0.3, -0.2, 0.1), (4.1, 0.2, 0.7), (12.0, 0.0, 0.0), (0.0, 9.0, 0.0))
TILTED = (0.0, float(np.sin(0.4)), 0.0, float(np.cos(0.4)))
ROW = tuple(((1.1 * i - 5.5, 0.2 * i, 0.0), 0.6) for i in range(11))
"""More spheres than a vector has lanes."""


@pytest.fixture(autouse=True)
def cpu(device):
    if not wp.get_device(device).is_cpu:
        pytest.skip("vector registers of a CPU")


def trap(i: int, *, moving: bool = False, **how) -> Trap:
    place = np.array(PLACES[i])
    path = Track(times=np.array([0.0, 1.0]), values=np.array([place, place + 2.0])) if moving else None
    power = Track.constant(20.0 + i)
    return Trap(
        prim=f"/World/T{i}", position=path or Track.constant(place), power=power, model="table", tolerance=1e-2, **how
    )


def scene(count: int = 3, *, shape=None, **how) -> Scene:
    body = robot("R", (0.1, 0.0, 0.3), (0.05, 0.02, 0.0, 1.0), **({"shape": shape} if shape else {}))
    return Scene(bodies=(body,), traps=tuple(trap(i, **how) for i in range(count)), settings=Settings(brownian=True))


SCENES = {
    "circular": SimpleNamespace(scene=scene(), block=(1, True)),
    "within reach": SimpleNamespace(scene=scene(reach=1.0), block=(1, True)),
    "linear": SimpleNamespace(scene=scene(polarization="x"), block=(2, True)),
    "vortex": SimpleNamespace(scene=scene(1, polarization="x", charge=1), block=(3, True)),
    "tilted": SimpleNamespace(scene=scene(orientation=TILTED), block=(1, False)),
    "tilted, linear": SimpleNamespace(scene=scene(orientation=TILTED, polarization="x"), block=(2, False)),
    "moving": SimpleNamespace(scene=scene(moving=True), block=(1, True)),
    "five traps": SimpleNamespace(scene=scene(5), block=(1, True)),
    "eleven spheres": SimpleNamespace(scene=scene(shape=ROW), block=(1, True)),
}


def final(case: Scene, device: str, *, lanes: bool) -> tuple[Simulation, np.ndarray]:
    sim = Simulation(case, worlds=WORLDS, seed=3, device=device, time_step=TIME_STEP)
    assert sim.model.features.lanes
    features = replace(sim.model.features, lanes=lanes)
    parts = StepperParts(make_step(features), sim.model, sim.state, sim.control, sim.last_readout, threads=1)
    sim._stepper = FusedStepper(parts)
    sim.step(STEPS)
    return sim, np.concatenate([sim.state.position.numpy(), sim.state.orientation.numpy()], axis=-1)


RARE = {"linear", "tilted"}
"""Cases whose parts stand in others as well; each compiles two vectorised modules."""


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.validate) if n in RARE else n for n in SCENES])
def test_forces_are_those_of_the_terms(name, device):
    """Roundings apart, the sums being in another order."""
    case = SCENES[name]
    sim, block = final(case.scene, device, lanes=True)
    assert blocked_table(sim.model.features) == case.block
    _, one_by_one = final(case.scene, device, lanes=False)
    np.testing.assert_allclose(block, one_by_one, atol=AGREEMENT)
    dark = replace(case.scene, traps=tuple(replace(t, power=Track.constant(0.0)) for t in case.scene.traps))
    _, free = final(dark, device, lanes=True)
    assert np.abs(block - free).max() > 100 * AGREEMENT
