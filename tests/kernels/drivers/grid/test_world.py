"""Worlds that a block of threads has to itself: as launches for all worlds, and whatever order its threads go in."""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData
from otwarp.kernels.drivers.grid.data import GridData, PushData
from otwarp.kernels.drivers.grid.teams import Lane
from otwarp.kernels.drivers.grid.world import steps_term
from otwarp.scene import Scene
from otwarp.simulation.drivers.block_stepper import BlockStepper
from otwarp.simulation.drivers.grid_phases_stepper import GridPhasesStepper
from otwarp.simulation.drivers.grid_stepper import GridStepper
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import robot
from tests.simulation.test_determinism import crowd_scene

SETTLED = {"position": 2e-5, "orientation": 2e-5, "force": 2e-3, "load": 2e-3, "escape": 0.0}
"""Differences after 60 steps [µm, pN] of two orders of sweeps that leave 1e-6 µm of a gap."""
LANES = 5
STEPS = 12


def with_robot() -> Scene:
    """The heap of the crowd with a robot over it: contacts of bodies that turn, second stages and escapes."""
    base = crowd_scene()
    return dataclasses.replace(base, bodies=(*base.bodies, robot("R", (4.0, 2.0, 5.5), collides=True)))


def ended(sim: Simulation) -> dict[str, np.ndarray]:
    """What steps have changed."""
    return {
        "position": sim.state.position.numpy(),
        "orientation": sim.state.orientation.numpy(),
        "force": sim.readout.contact_force.numpy(),
        "load": sim.readout.contact_load.numpy(),
        "escape": sim.readout.escape_step.numpy(),
    }


def stepped(scene: Scene, device: str, stepper: type | tuple[type, ...]) -> dict[str, np.ndarray]:
    """Two worlds after some steps in two calls."""
    sim = Simulation(scene, worlds=2, seed=4, device=device)
    assert isinstance(sim._stepper, stepper)
    for n in (20, 40):
        sim.step(n)
    return ended(sim)


@pytest.mark.thorough
@pytest.mark.parametrize("turns", [pytest.param(True, marks=pytest.mark.cpu_forms), False])
@pytest.mark.parametrize("make", [crowd_scene, with_robot])
def test_a_world_by_itself_is_that_of_launches_for_all(make, turns, monkeypatch, device):
    """Contacts in turns bit for bit, and in sweeps to what these leave; of lone spheres and of bodies that turn."""
    if not turns:
        monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    alone = stepped(make(), device, (BlockStepper, GridPhasesStepper))
    monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", 0)
    together = stepped(make(), device, GridStepper)
    assert np.count_nonzero(alone["load"]) > 10
    in_turn = turns and wp.get_device(device).is_cpu
    for name, value in alone.items():
        np.testing.assert_allclose(
            value, together[name], rtol=0.0, atol=0.0 if in_turn else SETTLED[name], err_msg=name
        )


_ONE_AT_A_TIME = """
    // one thread at a time runs between two barriers: 0 is free, and whoever comes first goes on
    static int held = 0, arrived = 0, times = 0;
    int yield() asm("sched_yield");
    auto enter = [&] { while (__atomic_exchange_n(&held, 1, __ATOMIC_ACQ_REL)) yield(); };
    if (what == 0) { enter(); return; }
    if (what == 2) { __atomic_store_n(&held, 0, __ATOMIC_RELEASE); return; }
    const int now = __atomic_load_n(&times, __ATOMIC_ACQUIRE);
    const bool last = ++arrived == LANES;
    if (last) { arrived = 0; __atomic_store_n(&times, now + 1, __ATOMIC_RELEASE); }
    __atomic_store_n(&held, 0, __ATOMIC_RELEASE);
    while (__atomic_load_n(&times, __ATOMIC_ACQUIRE) == now) yield();
    enter();
""".replace("LANES", str(LANES))


@wp.func_native(_ONE_AT_A_TIME)
def meet(what: int):
    """Begin (0), wait for all (1), or end (2) as one of `LANES` threads of which one runs at a time."""
    ...


@wp.func
def all_together():
    """In place of the barrier of a block."""
    meet(1)


@wp.func
def team_together(me: Lane):
    """In place of the barrier of a team."""
    meet(1)


@wp.func_native("static int heard = 0; if (what == 0) heard |= said; if (what == 2) heard = 0; return heard;")
def hear(what: int, said: int) -> int:
    """Add (0), read (1) or forget (2) what the threads have said; one of them runs at a time."""
    ...


@wp.func
def any_together(me: Lane, said: int) -> int:
    """In place of the vote of a team."""
    hear(0, said)
    meet(1)
    found = hear(1, 0)
    meet(1)
    hear(2, 0)
    meet(1)
    return found


def one_lane(sim: Simulation) -> wp.Kernel:
    """Kernel that goes through the steps of the world of a simulation as one of `LANES`."""
    take_steps = steps_term(sim.model.features)

    @wp.kernel(module="unique", enable_backward=False)
    def lane_steps(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData,
        lane: int, steps: int,
    ):  # fmt: skip
        """Take `steps` steps from step 0."""
        meet(0)
        me = Lane(0, lane, LANES, 0)
        take_steps(model, control, state, readout, grid, push, me, wp.int64(0), steps, wp.int64(steps), 1)
        meet(2)

    return lane_steps


@pytest.mark.thorough
def test_threads_of_a_block_go_in_any_order_between_barriers(monkeypatch, device):
    """One lane on its own, and five that take turns as they happen to come: the same bits, or they would race."""
    if not wp.get_device(device).is_cpu:
        pytest.skip("the barrier is a CPU's")
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    whole, shared = (Simulation(with_robot(), seed=4, device=device) for _ in range(2))
    whole.step(STEPS)
    monkeypatch.setattr("otwarp.kernels.drivers.grid.world.keep_together", all_together)
    for room in ("world", "entry_sweeps"):
        monkeypatch.setattr(f"otwarp.kernels.drivers.grid.{room}.meet", team_together)
    monkeypatch.setattr("otwarp.kernels.drivers.grid.entry_sweeps.any_of", any_together)
    kernel = one_lane(shared)
    stepper: Any = shared._stepper
    control, state, readout = (part.data() for part in (shared.control, shared.state, shared.last_readout))
    views = [shared.model.data, control, state, readout, stepper.scratch, stepper.push]
    kernel.module.load(device, 1)
    with ThreadPoolExecutor(LANES) as pool:
        list(pool.map(lambda n: wp.launch(kernel, dim=1, inputs=[*views, n, STEPS], device=device), range(LANES)))
    expected, found = ended(whole), ended(shared)
    assert np.count_nonzero(expected["load"]) > 5
    for name, value in expected.items():
        np.testing.assert_array_equal(found[name], value, err_msg=name)
