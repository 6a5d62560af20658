"""The CPU's form of the `solo` driver against the plain one: the same bits, whoever shares a body's thread."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from otwarp import Simulation
from otwarp.errors import SimulationError
from otwarp.kernels.drivers.lane_groups import GROUP
from otwarp.kernels.step import make_step
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Flow, Scene, Settings, Sphere, Track, Trap
from otwarp.simulation.drivers.stepping import FusedStepper, StepperParts

WORLDS = GROUP + 3
"""One full thread and one that is not."""

STEPS = (1, 37, 16, 5)
"""Calls that end within a block of noise, at its end and beyond."""

LOOSE = TrapLaw(stiffness=0.01, cutoff=0.4)
"""A trap too weak to hold: a sphere of 1.5 µm strays over its rim within a few hundred steps."""

PLACES = ((3.0, 5.0, 7.0), (30.0, 5.0, 7.0), (3.0, 50.0, 7.0))
TIME_STEP = 1e-3
FAR = 2e9
"""Farther than any scene [µm]: a fault at the next step."""


@pytest.fixture(autouse=True)
def cpu(device):
    if not wp.get_device(device).is_cpu:
        pytest.skip("the form for CPUs")


def bead(place: tuple[float, float, float], name: str) -> Body:
    sphere = Sphere(prim=f"/World/{name}/sphere", radius=1.5, collides=False)
    return Body(prim=f"/World/{name}", position=place, spheres=(sphere,))


def dimer(place: tuple[float, float, float], name: str) -> Body:
    spheres = tuple(
        Sphere(prim=f"/World/{name}/sphere{i}", offset=(x, 0.0, 0.0), radius=1.5, collides=False)
        for i, x in enumerate((-1.5, 1.5))
    )
    return Body(prim=f"/World/{name}", position=place, spheres=spheres)


def trap(place: tuple[float, float, float], name: str, *, moving: bool = False) -> Trap:
    """A weak trap, or one that leaves at 1 µm/s."""
    there = (place[0] + 1.0, *place[1:])
    path = Track(times=np.array([0.0, 1.0]), values=np.array([place, there])) if moving else Track.constant(place)
    return Trap(
        prim=f"/World/{name}", position=path, power=Track.constant(5.0), model="harmonic", radial=LOOSE
    )  # fmt: skip


def scene(*bodies: Body, traps: int = 1, moving: bool = False) -> Scene:
    lights = tuple(trap(place, f"trap{i}", moving=moving) for i, place in enumerate(PLACES[:traps]))
    return Scene(bodies=bodies, traps=lights, settings=Settings(brownian=True))


SCENES = {
    "one trap": scene(bead(PLACES[0], "a")),
    "two traps": scene(bead(PLACES[0], "a"), bead(PLACES[1], "b"), traps=2),
    "three traps": scene(bead(PLACES[0], "a"), bead(PLACES[2], "b"), traps=3),
    "moving trap": scene(bead(PLACES[0], "a"), moving=True),
    "rigid": scene(dimer(PLACES[0], "a"), traps=3),
    "mixed": scene(dimer(PLACES[0], "a"), bead(PLACES[1], "b"), bead(PLACES[2], "c"), traps=3),
    "free": Scene(bodies=(bead(PLACES[0], "a"),)),
    "flow": Scene(
        bodies=(bead(PLACES[0], "a"),),
        flow=Flow(prim="/World", kind="poiseuille", orientation=(0.5, 0.5, -0.1, 0.7), half_height=40.0, speed=10.0),
    ),
    "still": Scene(
        bodies=(bead((3.1, 5.0, 7.0), "a"),), traps=(trap(PLACES[0], "t"),), settings=Settings(brownian=False)
    ),
}

ALONE = [name for name in SCENES if name not in ("rigid", "mixed")]
"""Scenes of lone spheres; the others are in `test_lanes_rigid`."""


def simulation(
    name: str, device: str, *, lanes: bool, integrator: str = "heun", noise: str = "gaussian", threads: int = 1
) -> Simulation:
    """A simulation that steps in one of the two forms."""
    sim = Simulation(
        SCENES[name],
        worlds=WORLDS,
        seed=5,
        device=device,
        time_step=TIME_STEP,
        integrator=integrator,
        threads=threads,
    )
    f = sim.model.features
    features = replace(f, lanes=lanes, vectors=lanes and f.vectors, noise=noise)
    parts = StepperParts(make_step(features), sim.model, sim.state, sim.control, sim.last_readout, threads)
    sim._stepper = FusedStepper(parts)
    return sim


def outcome(sim: Simulation) -> list[np.ndarray]:
    """All that a run leaves, floats as bits."""
    state, readout = sim.state, sim.last_readout
    floats = [a.numpy().view(np.uint32) for a in (state.position, state.orientation)]
    return [*floats, readout.escape_step.numpy(), readout.fault.numpy(), readout.fault_step.numpy()]


def assert_same(one: Simulation, other: Simulation) -> None:
    for a, b in zip(outcome(one), outcome(other), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_cpu_steps_in_lanes(device):
    assert Simulation(SCENES["free"], device=device).model.features.lanes


@pytest.mark.parametrize("name", ALONE)
def test_bits_are_those_of_a_thread_of_its_own(name, device):
    lanes, plain = (simulation(name, device, lanes=form) for form in (True, False))
    for steps in STEPS:
        lanes.step(steps)
        plain.step(steps)
        assert_same(lanes, plain)


@pytest.mark.parametrize("name", ["one trap"])
def test_escapes_are_those_of_a_thread_of_its_own(name, device):
    """Long enough for spheres to be lost, most of them within a launch."""
    lanes, plain = (simulation(name, device, lanes=form) for form in (True, False))
    for sim in (lanes, plain):
        sim.step(1500)
    lost = lanes.last_readout.escape_step.numpy()
    assert np.count_nonzero(lost.max(axis=1) > 0) > WORLDS // 2
    assert_same(lanes, plain)


@pytest.mark.parametrize("integrator", ["eulerMaruyama", "leimkuhlerMatthews", "exponential"])
@pytest.mark.parametrize("name", ["one trap"])
def test_every_integrator(name, integrator, device):
    """Leimkuhler–Matthews looks one step ahead in the noise, across the end of a block."""
    lanes, plain = (simulation(name, device, lanes=form, integrator=integrator) for form in (True, False))
    for steps in STEPS:
        lanes.step(steps)
        plain.step(steps)
    assert_same(lanes, plain)


@pytest.mark.parametrize(("name", "noise"), [("one trap", "threePoint")])
def test_every_noise(name, noise, device):
    lanes, plain, gaussian = (
        simulation(name, device, lanes=form, noise=kind)
        for form, kind in ((True, noise), (False, noise), (True, "gaussian"))
    )
    for sim in (lanes, plain, gaussian):
        sim.step(40)
    assert_same(lanes, plain)
    assert np.all(lanes.state.position.numpy() != gaussian.state.position.numpy())


@pytest.mark.parametrize("name", ["two traps"])
def test_calls_and_threads_leave_no_trace(name, device):
    whole, parts, shared = (simulation(name, device, lanes=True, threads=n) for n in (1, 1, 3))
    whole.step(sum(STEPS))
    shared.step(sum(STEPS))
    for steps in STEPS:
        parts.step(steps)
    assert_same(whole, parts)
    assert_same(whole, shared)


@pytest.mark.parametrize("name", ["one trap"])
def test_a_body_with_a_fault_stops_alone(name, device):
    hurt, well = (simulation(name, device, lanes=True) for _ in range(2))
    start = hurt.state.position.numpy()
    start[2, 0] = (FAR, 0.0, 0.0)
    hurt.set_state(position=start)
    with pytest.raises(SimulationError) as caught:
        hurt.step(40)
    well.step(40)
    assert (caught.value.world, caught.value.step) == (2, 0)
    others = np.arange(WORLDS) != 2
    np.testing.assert_array_equal(hurt.state.position.numpy()[others], well.state.position.numpy()[others])
    np.testing.assert_array_equal(hurt.state.position.numpy()[2, 0], np.float32([FAR, 0.0, 0.0]))
    np.testing.assert_array_equal(hurt.last_readout.fault_step.numpy()[2], 0)
