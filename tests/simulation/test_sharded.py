"""Worlds on several devices are those of one device, bit for bit, in whatever way they are split."""

from __future__ import annotations

import re

import numpy as np
import pytest

import otwarp as ot
from otwarp.simulation.frame import SHAPES, capture_frame
from tests.simulation.crowds import crowd, jumbled
from tests.simulation.test_determinism import touching_scene
from tests.simulation.test_episodes import lossy_scene

WORLDS = 8
POWER = np.linspace(15.0, 20.0, WORLDS)[:, None]
FOCI = np.zeros((WORLDS, 1, 3)) + np.linspace(0.0, 0.01, WORLDS)[:, None, None]


def soft_crowd() -> ot.Scene:
    return crowd(jumbled(27), temperature=298.15)


def stiff_crowd() -> ot.Scene:
    return touching_scene()


def options(device) -> dict:
    return {"seed": 31, "parameters": {"trap_power": POWER}}


@pytest.fixture(params=[1, 2, 3, 8])
def pair(request, device):
    """One device, and the same worlds in so many parts."""
    named = {"worlds": WORLDS, "ends": [ot.escaped, ot.timed_out(after=np.linspace(0.5, 4.0, WORLDS))]}
    whole = ot.Simulation(lossy_scene(), device=device, **named, **options(device))
    parts = ot.ShardedSimulation(lossy_scene(), devices=[device] * request.param, **named, **options(device))
    assert parts.time_step == whole.time_step
    return whole, parts


def check_equal(whole, parts) -> None:
    for group in ("state", "readout", "episodes"):
        for name in {"state": ["position"], "episodes": ["done", "step", "number"]}.get(
            group, ["trap_position", "trap_force", "trap_distance", "escape_step", "fault"]
        ):
            expected = getattr(getattr(whole, group), name).numpy()
            assert getattr(getattr(parts, group), name).tobytes() == expected.tobytes(), name


def test_parts_are_the_whole(pair):
    whole, parts = pair
    for sim in pair:
        sim.step(100)
    check_equal(*pair)
    whole.control.set(trap_position=FOCI, trap_power=19.0)
    parts.control.set(trap_position=FOCI, trap_power=19.0)
    for sim in pair:
        sim.step(30)
        sim.reset([1, 6], position=np.zeros((WORLDS, 1, 3)))
        sim.step(70)
    check_equal(*pair)
    assert parts.episodes.running == whole.episodes.running
    start = np.linspace(0.0, 0.01, 3 * WORLDS).reshape(WORLDS, 1, 3)
    for sim in pair:
        sim.reset(number=np.arange(50, 50 + WORLDS))
        sim.set_state(position=start)
        sim.run(50 * whole.time_step)
    check_equal(*pair)
    assert parts.time == whole.time
    left, right = capture_frame(whole), parts.frame()
    for name in SHAPES:
        assert np.array_equal(getattr(left, name), getattr(right, name), equal_nan=True), name


@pytest.mark.thorough
def test_a_part_alone_is_a_slice_of_the_whole_without_episodes(device):
    whole = ot.Simulation(lossy_scene(), worlds=WORLDS, device=device, **options(device))
    part = ot.Simulation(lossy_scene(), worlds=WORLDS, part=(5, 7), device=device, **options(device))
    for sim in (whole, part):
        sim.step(200)
    assert part.state.position.shape == (2, 1)
    assert np.array_equal(part.state.position.numpy(), whole.state.position.numpy()[5:7])
    assert np.array_equal(part.readout.escape_step.numpy(), whole.readout.escape_step.numpy()[5:7])


def test_a_fault_in_a_part_names_its_world(device):
    parts = ot.ShardedSimulation(lossy_scene(), devices=[device, device], worlds=WORLDS, **options(device))
    place = np.zeros((WORLDS, 1, 3))
    place[6] = (9e8, 1.1e8, 0.0)
    parts.set_state(position=place)
    with pytest.raises(ot.SimulationError, match="world 6"):
        parts.step(10)


def test_commands_are_accepted_by_all_parts_or_by_none(device):
    with ot.ShardedSimulation(lossy_scene(), devices=[device] * 3, worlds=WORLDS, **options(device)) as parts:
        assert np.array_equal(parts.control.trap_power, POWER.astype(np.float32))
        rising = np.full((WORLDS, 1), 19.0)
        rising[-1] = 1e6  # mW
        with pytest.raises(ot.InputError, match="power"):
            parts.control.set(trap_position=FOCI, trap_power=rising)
        assert np.array_equal(parts.control.trap_power, POWER.astype(np.float32))
        parts.control.set(trap_position=(0.0, 0.0, 0.1), follow=0)
        assert parts.control.trap_position.shape == (WORLDS, 1, 3) and parts.control.follow.tolist() == [0]
    with pytest.raises(RuntimeError, match="shutdown"):
        parts.step()


def test_what_is_not_of_all_worlds_is_read_from_a_shard(device):
    named = {"worlds": 4, "ends": [ot.timed_out(after=1.0)], "seed": 31}
    with ot.ShardedSimulation(lossy_scene(), devices=[device] * 2, **named) as parts:
        assert parts.episodes.running == 4 and parts.episodes.time.shape == (4,)
        for group, name in (("episodes", "count"), ("episodes", "values"), ("readout", "fault_count")):
            with pytest.raises(ot.InputError, match=rf"{name} is each shard's own; allowed: shards\[n\]\.{group}"):
                getattr(getattr(parts, group), name)
        with pytest.raises(ot.InputError, match="position has 5 rows; allowed: 4, one for each world"):
            parts.set_state(position=np.zeros((5, 1, 3)))


def test_all_parts_have_taken_their_steps_when_one_fails(device):
    parts = ot.ShardedSimulation(lossy_scene(), devices=[device, device], worlds=WORLDS, **options(device))
    place = np.zeros((WORLDS, 1, 3))
    place[0] = (9e8, 1.1e8, 0.0)
    parts.set_state(position=place)
    steps = 300_000 // WORLDS
    with pytest.raises(ot.SimulationError, match="world 0"):
        parts.step(steps)
    assert parts.shards[1].time == pytest.approx(steps * parts.time_step)


def test_one_gpu_is_waited_for_by_one_thread(device):
    """Two would use its stream at once; those of a CPU step side by side."""
    parts = ot.ShardedSimulation(lossy_scene(), devices=[device, device], worlds=WORLDS, **options(device))
    on_gpu = parts.shards[0].model.device.is_cuda
    assert (parts._threads[0] is parts._threads[1]) == on_gpu


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"devices": "cpu"}, r"devices is 'cpu'; allowed: a list"),
        ({"devices": []}, r"devices is \[\]; allowed: a list"),
        ({"devices": None}, "devices is None; allowed: a list"),
        ({"worlds": 1}, "worlds is 1; allowed: 2 or more"),
        ({"part": (0, 1)}, r"part is \(0, 1\); allowed: none, each of the devices has a part of its own"),
        ({"device": "cpu"}, "device is 'cpu'; allowed: none"),
    ],
)
def test_what_cannot_be_shared_out(change, says, device):
    named = {"devices": [device, device], "worlds": WORLDS, **change}
    with pytest.raises(ot.InputError, match=says):
        ot.ShardedSimulation(lossy_scene(), **named)


@pytest.mark.parametrize("part", [(3, 3), (-1, 2), (0, 9), (5, 2), (9, 2), ("a", 2), (1, 2, 3), 3])
def test_a_part_is_within_the_whole(part, device):
    says = f"part is {part!r}; allowed: two whole numbers from 0 to {WORLDS}, the first of them smaller"
    with pytest.raises(ot.InputError, match=re.escape(says)):
        ot.Simulation(lossy_scene(), worlds=WORLDS, part=part, device=device)


@pytest.mark.thorough
@pytest.mark.parametrize("make", [pytest.param(soft_crowd, marks=pytest.mark.thorough), stiff_crowd])
def test_parts_of_many_body_scenes(make, monkeypatch, device):
    """Noise, parameters and faults go by the world among all."""
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    viscosity = {"medium_viscosity": np.linspace(8e-4, 1e-3, 3)}
    whole = ot.Simulation(make(), device=device, worlds=3, seed=31, parameters=viscosity)
    parts = ot.ShardedSimulation(make(), devices=[device] * 2, worlds=3, seed=31, parameters=viscosity)
    assert whole.model.features.driver == "grid"
    for sim in (whole, parts):
        sim.step(40)
    assert parts.state.position.tobytes() == whole.state.position.numpy().tobytes()
    assert parts.readout.contact_load.tobytes() == whole.readout.contact_load.numpy().tobytes()
    assert np.any(parts.readout.contact_load) and len(np.unique(parts.state.position[:, 0, 0])) == 3
    if not whole.model.features.soft_contacts:
        monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", 0)
    says = "contacts are explicit" if whole.model.features.soft_contacts else "a scene of .* bodies that can touch each"
    with pytest.raises(ot.InputError, match=rf"ends is given; allowed: none in .*{says}"):
        ot.Simulation(make(), device=device, ends=[ot.timed_out(after=1.0)])
