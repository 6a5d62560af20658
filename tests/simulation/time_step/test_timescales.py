"""What limits the time step: every motion that the step must resolve, and no trap forgotten."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.kernels.terms import terms
from otwarp.scene import Flow, Material, Medium, Obstacle, Scene, Settings, Track
from otwarp.simulation.info import describe
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.simulation import Simulation
from otwarp.units import STANDARD_GRAVITY
from tests.simulation.setups import (
    FIVE,
    STIFFNESS,
    VISCOSITY,
    bead_scene,
    drag,
    five_sphere_mobility,
    harmonic,
    line,
    neutral,
    obstacle,
    robot,
    sphere_body,
)

FRAME = 1.0 / 60.0
QUIET = Settings(brownian=False)


def scales(scene: Scene, **more):
    return Model.build(scene, device="cpu", **more).scales


@pytest.mark.thorough
def test_adhesion_limits_the_step(device):
    """W/3η, the approach of two spheres under 2πRW whatever their radii; the cells do not pass through each other."""
    soft = Material(youngs_modulus=1e3, adhesion=10.0, adhesion_range=0.05)
    cells = (
        neutral("A", (0.0, 0, 0), radius=5.0, material=soft),
        neutral("B", (10.02, 0, 0), radius=5.0, material=soft),
    )
    scene = Scene(bodies=cells, settings=QUIET)
    found = scales(scene)
    assert found.time_step == pytest.approx(0.5 / (10.0 / (3.0 * VISCOSITY)), rel=1e-3)  # a whole number in a run
    assert found.chosen_by == "approach under adhesion"
    sim = Simulation(scene, device=device)
    sim.run(0.02)
    gap = np.diff(sim.state.position.numpy()[0, :, 0])[0] - 10.0
    assert -2.5 < gap < 0.0


def test_weight_limits_the_step(device):
    heavy = sphere_body("B", (0.0, 0.0, 12.0), radius=10.0, collides=True, density=8000e-12)
    scene = Scene(bodies=(heavy,), obstacles=(obstacle("F", "plane", (0, 0, 0)),), settings=Settings(gravity=True))
    speed = (8000e-12 - Medium().density) * 4 / 3 * np.pi * 1e3 * STANDARD_GRAVITY / drag(10.0)
    found = scales(scene)
    assert found.settling == pytest.approx(1.0 / speed)
    assert found.chosen_by == "sinking or rising under weight"
    sim = Simulation(scene, device=device)
    sim.run(0.05)
    assert 9.5 < float(sim.state.position.numpy()[0, 0, 2]) < 10.0


def paddle(turns_per_second: float) -> Obstacle:
    """A bar of 20 µm about z, sampled every 10°."""
    times = np.arange(37) / 36 / turns_per_second
    half = np.pi * times * turns_per_second
    turn = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], axis=1)
    bar = obstacle("Bar", "box", line((0.0, (0, 0, 0)), (1.0, (0, 0, 0))), (10.0, 0.5, 2.0))
    place = Track(times=times, values=np.zeros((37, 3)))
    return dataclasses.replace(bar, position=place, orientation=Track(times=times, values=turn))


def test_turning_obstacles_limit_the_step(device):
    """ω times the radius of the bar's bounding sphere; the bar pushes a bead instead of sweeping through it."""
    scene = Scene(bodies=(neutral("B", (6.0, 2.5, 0.0)),), obstacles=(paddle(4.0),), settings=QUIET)
    rim = 2.0 * np.pi * 4.0 * np.linalg.norm([10.0, 0.5, 2.0])
    assert scales(scene).travel == pytest.approx(0.1 / rim, rel=1e-3)
    rows = describe(scene, device="cpu")["obstacles"]
    assert [row["moves"] for row in rows] == [True]
    plane = dataclasses.replace(paddle(4.0), shape="plane", size=(0.0, 0.0, 0.0))
    far = dataclasses.replace(scene, obstacles=(plane,))
    assert scales(far).travel == pytest.approx(0.1 / (2.0 * np.pi * 4.0 * 6.5), rel=1e-3)


def test_shear_limits_the_step():
    """γ̇ times the farthest height, and for a rigid body γ̇ itself, contact or not."""
    flow = Flow(prim="/World/F", kind="shear", shear_rate=100.0, origin=(0.0, 0.0, 1.0))
    bead = neutral("B", (0.0, 0.0, 11.0))
    floor = obstacle("F", "plane", (0, 0, 0))
    assert scales(Scene(bodies=(bead,), obstacles=(floor,), flow=flow)).travel == pytest.approx(0.1 / (100.0 * 11.0))
    dimer = robot("D", shape=FIVE[:2])
    found = scales(Scene(bodies=(dimer,), flow=flow))
    assert found.time_step == pytest.approx(0.1 / 100.0)
    assert found.chosen_by == "turning of rigid bodies by flow and weight"
    assert scales(Scene(bodies=(sphere_body("B"),), flow=flow)).chosen_by == "frame interval"


def five_traps(shift: float, *, named: bool) -> Scene:
    """A five-sphere robot, and a trap for every sphere that starts `shift` away from it."""
    traps = tuple(
        harmonic(f"T{i}", line((0.0, np.add(o, (0, shift, 0))), (1.0, o)), cutoff=1.2,
                 holds=f"/World/R/S{i}" if named else None)
        for i, (o, _) in enumerate(FIVE)
    )  # fmt: skip
    return Scene(bodies=(robot("R"),), traps=traps)


@pytest.mark.parametrize("named", [True, False])
def test_traps_that_come_later_count(named):
    """The rate is that of all five traps in place, not that of a lone sphere; a trap elsewhere by override, too."""
    here = scales(five_traps(0.0, named=True))
    move = five_sphere_mobility()
    total = np.zeros((6, 6))
    for offset, _ in FIVE:
        x, y, z = np.array(offset) - move.reference
        lever = np.hstack([np.eye(3), -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])])
        total += STIFFNESS * lever.T @ lever
    rate = np.linalg.eigvals(move.mobility @ total).real.max() / VISCOSITY
    assert 1.0 / here.trap_relaxation == pytest.approx(rate)
    assert scales(five_traps(50.0, named=named)).trap_relaxation == pytest.approx(here.trap_relaxation)
    far = np.add([o for o, _ in FIVE], (0.0, 90.0, 0.0))
    moved = scales(five_traps(0.0, named=named), parameters={"trap_position": far})
    assert moved.trap_relaxation == pytest.approx(here.trap_relaxation)


def test_overrides_reach_what_a_trap_holds(device):
    """A shorter cutoff, per world: reach, held sphere and escapes are those of the parameters."""
    scene = dataclasses.replace(bead_scene(time_step=1e-4), traps=(harmonic("T", (0.4, 0, 0), cutoff=np.inf),))
    assert not Model.build(scene, device=device).features.escapes
    sim = Simulation(scene, worlds=2, device=device, parameters={"trap_cutoff": [[0.3], [1.5]]})
    assert sim.model.features.escapes
    assert sim.model.held == ((0, 0),)
    np.testing.assert_array_equal(sim.model.held_range, [[0.3], [1.5]])
    sim.step(3)
    assert sim.readout.escape_step.numpy().ravel().tolist() == [1, -1]
    away = Model.build(scene, device=device, parameters={"trap_position": (9.0, 0, 0), "trap_cutoff": 2.0})
    assert away.held == ((-1, -1),)
    assert np.isinf(away.held_range).all()


def test_motion_lost_in_rounding_is_announced(device):
    """0.3 µm/s in steps of 10 µs at x = 100 µm is less than the spacing of float32 there; noise would carry it."""
    flow = Flow(prim="/World/F", kind="uniform", speed=0.3)
    scene = Scene(bodies=(sphere_body("B", (100.0, 0, 0)),), flow=flow, settings=QUIET)
    with pytest.warns(
        UserWarning,
        match=r"without noise, of 0\.3 µm/s in time steps of 1e-05 s is lost.*at 100 µm; allowed: time steps",
    ):
        sim = Simulation(scene, device=device, time_step=1e-5)
    sim.step(1000)
    assert float(sim.state.position.numpy()[0, 0, 0]) == 100.0
    Model.build(scene, device=device, options=StepOptions(time_step=0.0001))  # warnings are errors here
    noisy = dataclasses.replace(scene, settings=Settings())
    Model.build(noisy, device=device, options=StepOptions(time_step=1e-05))
    slow = dataclasses.replace(noisy, traps=(harmonic("T", (100.0, 0, 0), speed_limit=0.3),))
    with pytest.warns(UserWarning, match="the speed limit of a trap, of 0.3 µm/s"):
        Model.build(slow, device=device, options=StepOptions(time_step=1e-05))


def test_the_neighbour_grid_is_not_announced_without_neighbours(device):
    """Thirty beads that cannot touch, with a speed limit."""
    beads = tuple(sphere_body(f"B{i}", (3.0 * i, 0, 0)) for i in range(30))
    scene = Scene(bodies=beads, traps=(harmonic("T", speed_limit=5.0),))
    found = {term: on for term, on, _ in terms(Model.build(scene, device=device).features)}
    assert not found["neighbour lists"]
