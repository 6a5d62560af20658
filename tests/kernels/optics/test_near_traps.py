"""Robots whose steps list the traps that may reach their spheres, beside robots whose steps look at all of them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from otwarp.bench.scenes import PLACE, robot, scene, spring
from otwarp.kernels.optics import near_traps
from otwarp.scene import Body, Flow, Scene, Sphere
from otwarp.simulation import composition
from otwarp.simulation.simulation import Simulation
from tests.gpu_forms import take_gpu_forms
from tests.kernels.samples import quaternions

STEPS = 2000

FLOW = Flow(prim="/World/flow", kind="uniform", speed=60.0)
"""Carries robots past traps that are too weak to hold them, by 6 µm in `STEPS`."""


def weak_traps_in_flow() -> Scene:
    return replace(robot(power=0.5), flow=FLOW)


def chain() -> Scene:
    """Twelve small spheres of which each trap reaches several: more pairs than are listed."""
    x, y, z = PLACE
    places = [(0.5 * i - 2.75, 0.0, 0.02 * (i - 5.5) ** 2) for i in range(12)]
    spheres = tuple(
        Sphere(prim=f"/World/robot/sphere{i}", offset=at, radius=0.3, collides=False) for i, at in enumerate(places)
    )
    body = Body(prim="/World/robot", position=PLACE, spheres=spheres)
    traps = tuple(
        spring(
            (x + places[i][0], y, z + places[i][2]),
            name=f"trap{i}",
            stiffness=4.0,
            cutoff=1.2,
            holds=f"/World/robot/sphere{i}",
        )
        for i in (2, 6, 9)
    )
    return replace(scene(body, traps=traps), flow=FLOW)


def one_trap_dark() -> Scene:
    what = weak_traps_in_flow()
    first, *others = what.traps
    return replace(what, traps=(replace(first, power=first.power.constant(0.0)), *others))


Make = Callable[[Scene, bool], Simulation]


@pytest.fixture
def make(monkeypatch, device) -> Make:
    """`(scene, listed, how…) -> Simulation` in the forms for GPUs, in worlds that begin in different poses."""
    take_gpu_forms(monkeypatch)
    lists = composition._lists_traps

    def made(what: Scene, listed: bool, **how) -> Simulation:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(composition, "_lists_traps", lists if listed else lambda f: False)
            sim = Simulation(what, worlds=8, seed=5, device=device, allow_large_step=True, **how)
        assert sim.model.features.listed == listed
        away = np.zeros((8, 1, 3), dtype=np.float32)
        # held; half out of reach; out of reach of all but a trap that holds another sphere; falling in from the side
        away[1:6, 0] = (0.7, 0.0, 0.0), (4.1, 0.0, 0.3), (0.0, 1.15, 0.0), (0.0, 0.0, 40.0), (-3.2, 0.4, 0.0)
        turn = np.tile(np.float32([0.0, 0.0, 0.0, 1.0]), (8, 1, 1))
        turn[6, 0] = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
        turn[7] = quaternions(np.random.default_rng(1), 1)
        sim.state.position.assign(sim.state.position.numpy() + away)
        sim.state.orientation.assign(turn)
        return sim

    return made


def glide(sim: Simulation, velocity: tuple[float, float, float]) -> None:
    """All traps at a velocity [µm/s]."""
    shape = (*sim.control.trap_velocity.shape, 3)
    sim.control.trap_velocity.assign(np.broadcast_to(np.float32(velocity), shape))


def end_of(sim: Simulation, steps: int = STEPS) -> list[np.ndarray]:
    """Poses, and when spheres were lost."""
    sim.step(steps // 3)
    sim.step(steps - steps // 3)
    return [
        array.numpy() for array in (sim.state.position, sim.state.orientation, sim.last_readout.escape_step)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("what", "rounding"),
    [
        (weak_traps_in_flow, 0.0),
        pytest.param(robot, 0.0, marks=pytest.mark.thorough),
        pytest.param(one_trap_dark, 0.0, marks=pytest.mark.thorough),
        # where several traps reach a sphere their sum has another order
        pytest.param(chain, 1e-4, marks=pytest.mark.thorough),
    ],
)
def test_a_list_leaves_out_what_does_not_reach(what, rounding, make):
    """To the bit: in poses from which robots fall into traps, out of them, or from one into another."""
    how = {"integrator": "eulerMaruyama", "time_step": 5e-5}
    sims = [make(what(), listed, **how) for listed in (True, False)]
    start = sims[0].state.position.numpy().copy()
    listed, looked_at = (end_of(sim) for sim in sims)
    for one, other in zip(listed, looked_at, strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=rounding)
    moved = np.linalg.norm(listed[0] - start, axis=-1)
    assert (moved > near_traps.SKIN * 1.2).sum() >= 2
    assert (listed[2] >= 0).any()


@pytest.mark.thorough
@pytest.mark.parametrize("glides", [False, True])
@pytest.mark.parametrize("integrator", ["heun", "exponential"])
def test_a_second_stage_that_strays_looks_at_all(integrator, glides, make):
    """Steps so long that their second stages look where other pairs are near; rounding is the only difference."""
    sims = [
        make(
            robot(power=0.5) if glides else weak_traps_in_flow(),
            listed,
            integrator=integrator,
            time_step=0.03,
            glides=glides,
        )
        for listed in (True, False)
    ]
    for sim in sims:
        if glides:
            glide(sim, (60.0, 0.0, 0.0))
    ends = [end_of(sim, steps=9) for sim in sims]
    assert np.abs(ends[0][0] - ends[1][0]).max() < 1e-3
    np.testing.assert_array_equal(ends[0][2], ends[1][2])


@pytest.mark.thorough
def test_traps_that_glide_use_up_the_leeway(make):
    """As they pass other spheres than those that they began with."""
    sims = [
        make(robot(power=0.5), listed, integrator="eulerMaruyama", time_step=5e-5, glides=True)
        for listed in (True, False)
    ]
    for sim in sims:
        glide(sim, (60.0, 0.0, 3.0))
    listed, looked_at = (end_of(sim) for sim in sims)
    for one, other in zip(listed, looked_at, strict=True):
        np.testing.assert_array_equal(one, other)
    assert (listed[2] >= 0).any()
