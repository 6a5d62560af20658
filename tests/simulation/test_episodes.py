"""Worlds that end and start anew: trials are the same bits in whatever world they run, and beside whatever else."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import warp as wp

import otwarp as ot
from otwarp.simulation.drivers.stepping import PhaseGraphs
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import bead_scene, harmonic, line
from tests.simulation.test_determinism import crowd_scene, touching_scene

WORLDS = 8
ENDED = [1, 4, 5]
"""Worlds that the tests end."""


def lossy_scene():
    """The bead in a trap that loses it within some hundred steps."""
    return dataclasses.replace(bead_scene(), traps=(harmonic("Trap", cutoff=0.03),))


SCENES = {"solo": lossy_scene, "world": touching_scene, "grid": crowd_scene}


@pytest.fixture(params=list(SCENES), scope="module")
def scene(request):
    return SCENES[request.param]()


def simulate(scene, device, worlds=WORLDS, ends=(), **more) -> Simulation:
    return Simulation(scene, worlds=worlds, seed=31, device=device, ends=ends, **more)


@pytest.fixture(scope="module")
def plain(scene, device):
    """(steps) → a simulation without episodes, of as many worlds as the tests run trials, at that step."""
    known = {}

    def at(steps: int) -> Simulation:
        if steps not in known:
            known[steps] = simulate(scene, device, worlds=3 * WORLDS, ends=None)
            known[steps].step(steps)
        return known[steps]

    return at


def assert_same_worlds(sim: Simulation, rows, other: Simulation, others) -> None:
    """Bit for bit, what `rows` of one and `others` of the other have come to."""
    for group in ("state", "readout"):
        for name, array in vars(getattr(sim, group)).items():
            if isinstance(array, wp.array) and name != "fault_count":
                there = getattr(getattr(other, group), name).numpy()[others]
                assert array.numpy()[rows].tobytes() == there.tobytes(), name


def finish(sim: Simulation, worlds) -> None:
    done = sim.episodes.done.numpy().copy()
    done[worlds] = 7
    sim.episodes.done.assign(done)


def test_worlds_are_those_of_a_simulation_without_episodes(scene, plain, device):
    sim = simulate(scene, device)
    for steps in (1, 90, 159):
        sim.step(steps)
    assert_same_worlds(sim, slice(None), plain(250), slice(WORLDS))
    assert sim.episodes.running == WORLDS and np.all(sim.episodes.step.numpy() == 250)
    assert sim.episodes.time == pytest.approx(np.full(WORLDS, 250 * sim.time_step))


@pytest.mark.parametrize("threads", [1, 3])
def test_what_has_ended_stands_still_and_nobody_else_notices(scene, plain, device, threads):
    sim = simulate(scene, device, threads=threads)
    sim.step(100)
    finish(sim, ENDED)
    sim.step(150)
    going = [w for w in range(WORLDS) if w not in ENDED]
    assert_same_worlds(sim, going, plain(250), going)
    assert np.array_equal(sim.state.position.numpy()[ENDED], plain(100).state.position.numpy()[ENDED])
    assert sim.episodes.running == len(going)
    assert sim.episodes.step.numpy()[ENDED].tolist() == [100] * len(ENDED)
    assert sim.episodes.done.numpy()[ENDED].tolist() == [7] * len(ENDED)


@pytest.mark.parametrize("compact", [True, False])
def test_a_reset_world_runs_the_next_trial(scene, plain, device, compact):
    """Which is that of a later world of a simulation without episodes, whether or not the world stood still before."""
    sim = simulate(scene, device)
    sim.step(60)
    if compact:
        finish(sim, ENDED)
    sim.step(40)
    sim.reset(ENDED)
    sim.step(250)
    assert_same_worlds(sim, ENDED, plain(250), np.add(ENDED, WORLDS))
    assert sim.episodes.number.numpy()[ENDED].tolist() == np.add(ENDED, WORLDS).tolist()
    sim.reset([4])
    sim.step(100)
    assert_same_worlds(sim, [4], plain(100), [4 + 2 * WORLDS])


def test_who_does_not_look_gets_the_same(scene, plain, device):
    """Worlds that ended since the last look stand still all the same."""
    sim = simulate(scene, device)
    sim.step(100)
    finish(sim, ENDED)
    for _ in range(3):
        sim.step(50, look=False)
    assert sim.episodes.at_most == WORLDS
    going = [w for w in range(WORLDS) if w not in ENDED]
    assert_same_worlds(sim, going, plain(250), going)
    assert np.array_equal(sim.state.position.numpy()[ENDED], plain(100).state.position.numpy()[ENDED])
    sim.step(1)
    assert sim.episodes.at_most == len(going)


def test_a_trial_by_its_number(scene, plain, device):
    sim = simulate(scene, device, worlds=3)
    sim.reset(number=[20, 3, 11])
    sim.step(250)
    assert_same_worlds(sim, slice(None), plain(250), [20, 3, 11])


def test_only_worlds_in_motion_are_launched(scene, device, monkeypatch):
    sim = simulate(scene, device, threads=1)
    if isinstance(sim._stepper, PhaseGraphs):
        pytest.skip("graphs are of powers of two")
    finish(sim, [w for w in range(WORLDS) if w != 6])
    spans, launch = [], sim._stepper._launch
    monkeypatch.setattr(sim._stepper, "_launch", lambda n, span, *more: (spans.append(span), launch(n, span, *more)))
    sim.step(10)
    sim.step(10)
    assert spans[-1] == (0, 1) and sim.episodes.running == 1
    finish(sim, [6])
    sim.step(10)
    sim.step(10)
    assert len(spans) <= 3 and sim.episodes.running == 0
    assert sim.state.step == 40 and sim.episodes.step.numpy().tolist() == [0] * 6 + [20, 0]


def test_escapes_end_worlds_and_count_from_the_reset(device):
    whole = Simulation(lossy_scene(), worlds=2 * WORLDS, seed=31, device=device)
    whole.step(4000)
    expected = whole.readout.escape_step.numpy()[:, 0]
    assert np.all(expected > 0), "the scene must lose its bead in all worlds, or the test is void"
    sim = simulate(lossy_scene(), device, ends=[ot.escaped])
    found = {}
    while len(found) < 2 * WORLDS:
        sim.step(50)
        assert np.array_equal(sim.episodes.done.numpy() > 0, sim.readout.escape_step.numpy()[:, 0] >= 0)
        steps = zip(sim.episodes.number.numpy(), sim.readout.escape_step.numpy()[:, 0], strict=True)
        found |= {int(n): int(s) for n, s in steps if s >= 0 and n < 2 * WORLDS}
        sim.reset(sim.episodes.done)
    assert [found[n] for n in range(2 * WORLDS)] == expected.tolist()


@ot.end
def above(now: ot.WorldNow, height: float, axis: int = 2) -> bool:
    return now.state.position[now.world, 0][axis] > height


def test_ends_have_codes_by_their_order_and_values_per_world(device):
    heights = np.full(WORLDS, 1e3)
    heights[[2, 5]] = -1e3
    step = simulate(lossy_scene(), device).time_step
    sim = simulate(lossy_scene(), device, ends=[ot.timed_out(after=30 * step), above(height=heights)])
    sim.step(10)
    assert sim.episodes.done.numpy().tolist() == [2 if w in (2, 5) else 0 for w in range(WORLDS)]
    sim.step(10)
    sim.step(10)
    assert sim.episodes.done.numpy().tolist() == [2 if w in (2, 5) else 1 for w in range(WORLDS)]
    assert sim.episodes.step.numpy().tolist() == [10 if w in (2, 5) else 30 for w in range(WORLDS)]


def test_places_reached_and_left(device):
    place = np.zeros((WORLDS, 1, 3))
    place[3] = place[4] = (0.01, 0.0, 0.0)
    ends = [ot.reached(goal=(0.01, 0.0, 0.0), radius=0.005), ot.strayed(origin=(0.0, 0.0, 0.0), radius=1.0)]
    sim = simulate(dataclasses.replace(lossy_scene(), settings=bead_scene(time_step=1e-7).settings), device, ends=ends)
    place[6] = (1.1, 0.0, 0.0)
    sim.reset(position=place)
    sim.step(1)
    assert sim.episodes.done.numpy().tolist() == [0, 0, 0, 1, 1, 0, 2, 0]


def test_a_fault_ends_its_world_alone(device):
    sim = simulate(lossy_scene(), device)
    place = sim.state.position.numpy().copy()
    place[2] = 9e8
    place[2, 0, 1] = 1.1e8
    sim.set_state(position=place)
    sim.step(10)
    assert sim.episodes.done.numpy().tolist() == [0, 0, -1, 0, 0, 0, 0, 0]
    assert sim.readout.fault.numpy()[:, 0].tolist() == [0, 0, 1, 0, 0, 0, 0, 0]
    sim.reset(sim.episodes.done)
    sim.step(10)
    assert not np.any(sim.episodes.done.numpy()) and not np.any(sim.readout.fault.numpy())


def test_each_world_has_its_own_time(device):
    """A trap that follows time samples starts anew with its world, and the readout says where it is."""
    moving = line((0.0, (0.0, 0.0, 0.0)), (1.0, (100.0, 0.0, 0.0)))
    scene = dataclasses.replace(bead_scene(), traps=(harmonic("Trap", moving),))
    sim = simulate(scene, device)
    sim.step(100)
    sim.reset([3])
    sim.step(50)
    time = np.where(np.arange(WORLDS) == 3, 50, 150) * sim.time_step
    assert sim.readout.trap_position.numpy()[:, 0, 0] == pytest.approx(100.0 * time, rel=1e-6)


@pytest.mark.parametrize("kind", ["flags", "int32", "bool", "host flags", "host int32", "indices", "one"])
def test_which_worlds_are_reset(kind, device):
    sim = simulate(lossy_scene(), device)
    sim.step(5)
    flags = np.isin(np.arange(WORLDS), [6] if kind == "one" else ENDED)
    given = {
        "flags": lambda: wp.array(flags, dtype=wp.bool, device=device),
        "bool": lambda: flags,
        "int32": lambda: wp.array(3 * flags.astype(np.int32), dtype=wp.int32, device=device),
        "host flags": lambda: flags.tolist(),
        "host int32": lambda: 3 * flags.astype(np.int32),
        "indices": lambda: ENDED,
        "one": lambda: 6,
    }[kind]()
    sim.reset(given)
    assert np.array_equal(sim.episodes.step.numpy() == 0, flags)


def test_poses_on_the_device_are_read_in_place(device):
    sim = simulate(lossy_scene(), device)
    rows = np.arange(3.0 * WORLDS, dtype=np.float32).reshape(WORLDS, 1, 3)
    sim.reset(ENDED, position=wp.array(rows, dtype=wp.vec3, device=device))
    place = sim.state.position.numpy()
    assert np.array_equal(place[ENDED], rows[ENDED]) and not np.any(place[[0, 2, 3, 6, 7]])
    sim.reset([0], position=rows[2])
    assert np.array_equal(sim.state.position.numpy()[0], rows[2])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"worlds": [8]}, "worlds has the index 8; allowed: .* indices from 0 to 7, each once"),
        ({"worlds": [True, False]}, r"worlds has shape \(2,\) and type bool; allowed: \(8,\) flags"),
        ({"worlds": np.ones(8)}, r"worlds has shape \(8,\) and type float64; allowed: \(8,\) flags of type bool"),
        ({"worlds": np.arange(8) % 2}, r"worlds has an index twice; allowed: \(8,\) flags of type bool or int32"),
        ({"worlds": [[1], [2, 3]]}, "worlds has .* type object; allowed"),
        ({"number": [1, 2]}, r"number is \(2,\); allowed: \(8,\) whole numbers, 0 to 2³² − 1"),
        ({"number": [-1] * 8}, r"number is \[-1.0\]; allowed"),
        ({"position": np.zeros((3, 1, 3))}, r"state position has shape \(3, 1, 3\); allowed: \(1, 3\) or \(8, 1, 3\)"),
        ({"orientation": (0, 0, 0, 1)}, "no body rotates; allowed: position alone"),
    ],
)
def test_what_a_reset_refuses(arguments, says, device):
    with pytest.raises(ot.InputError, match=says):
        simulate(lossy_scene(), device).reset(**arguments)


def test_what_a_reset_refuses_of_arrays_on_the_device(device):
    sim = simulate(lossy_scene(), device)
    with pytest.raises(ot.InputError, match=r"worlds has elements of float32; allowed: int32"):
        sim.reset(wp.zeros(WORLDS, dtype=wp.float32, device=device))
    with pytest.raises(ot.InputError, match=r"state position has shape \(3, 1\); allowed: \(1, 1\) or \(8, 1\)"):
        sim.reset(position=wp.zeros((3, 1), dtype=wp.vec3, device=device))
