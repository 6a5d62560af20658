"""A captured loop does what its steps do one by one, bit for bit, with a user's kernels before and after."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

import otwarp as ot
from otwarp.simulation.capture import steps_of_turn
from tests.simulation.test_episodes import WORLDS, lossy_scene


@wp.kernel
def aim(turn: wp.array(dtype=int), position: wp.array2d(dtype=wp.vec3)):
    """A trap that goes on by 1 nm a turn, in each world by another step."""
    world = wp.tid()
    position[world, 0] = position[world, 0] + wp.vec3(0.001 + 1.0e-4 * float(world), 0.0, 0.0)
    if world == 0:
        turn[0] = turn[0] + 1


@wp.kernel
def add(force: wp.array2d(dtype=wp.vec3), total: wp.array(dtype=wp.vec3)):
    world = wp.tid()
    total[world] = total[world] + force[world, 0]


class Loop:
    """A simulation with what its user launches around the steps."""

    def __init__(self, device):
        self.sim = ot.Simulation(lossy_scene(), worlds=WORLDS, seed=31, device=device, ends=[ot.escaped])
        self.sim.control.widen("trap_position")
        self.turn = wp.zeros(1, dtype=int, device=device)
        self.total = wp.zeros(WORLDS, dtype=wp.vec3, device=device)
        self.device = device

    def before(self):
        wp.launch(aim, dim=WORLDS, inputs=[self.turn, self.sim.control.trap_position], device=self.device)

    def after(self):
        wp.launch(add, dim=WORLDS, inputs=[self.sim.last_readout.trap_force, self.total], device=self.device)
        self.sim.reset(self.sim.episodes.done)


@pytest.mark.thorough
def test_a_captured_loop_is_the_loop(device):
    plain, loop = Loop(device), Loop(device)
    turn = loop.sim.capture(20, before=loop.before, after=loop.after, readout=True)
    assert loop.sim.state.step == 0 and loop.turn.numpy()[0] == 0, "nothing moves while it is recorded"
    for _ in range(12):
        plain.before()
        plain.sim.step(20)
        plain.sim.measure()
        plain.after()
    turn()
    turn(11)
    assert loop.turn.numpy()[0] == 12 and loop.sim.state.step == plain.sim.state.step == 240
    assert np.array_equal(loop.sim.state.position.numpy(), plain.sim.state.position.numpy())
    assert np.array_equal(loop.sim.episodes.number.numpy(), plain.sim.episodes.number.numpy())
    assert np.array_equal(loop.sim.episodes.step.numpy(), plain.sim.episodes.step.numpy())
    assert np.array_equal(loop.total.numpy(), plain.total.numpy())
    assert np.any(loop.sim.episodes.number.numpy() >= WORLDS), "some world must have been reset, or the test is void"
    for sim in (plain.sim, loop.sim):
        sim.step(30)
    assert np.array_equal(loop.sim.state.position.numpy(), plain.sim.state.position.numpy())


def test_all_worlds_are_stepped_without_a_list(device):
    """The same bits as with one, if what has ended starts anew in each turn, and whoever else makes a list between."""
    listed, whole = Loop(device), Loop(device)
    loops = [(one, one.sim.capture(20, after=one.after, every_world=one is whole)) for one in (listed, whole)]
    for turns in (3, 5):
        for one, turn in loops:
            turn(turns)
            assert whole is not one or one.sim.episodes.count.numpy()[0] == WORLDS
            # a list with a gap
            done = one.sim.episodes.done.numpy().copy()
            done[[2, 5]] = 7
            one.sim.episodes.done.assign(done)
            one.sim.step(10)
            assert one.sim.episodes.count.numpy()[0] < WORLDS
            one.sim.reset(one.sim.episodes.done)
    for name, array in whole.sim.arrays().items():
        assert np.array_equal(array.numpy(), listed.sim.arrays()[name].numpy()), name
    assert np.any(whole.sim.episodes.number.numpy() >= 3 * WORLDS), "some must have escaped, or the test is void"


def test_a_world_that_is_ended_between_turns_moves_where_all_do(device):
    """Its clock stands and its code stays; a trial started anew is what it would have been."""
    sim = ot.Simulation(lossy_scene(), worlds=WORLDS, seed=31, device=device, ends=())
    turn = sim.capture(20, every_world=True)
    turn()
    before = sim.state.position.numpy()
    before, done = before.copy(), np.where(np.arange(WORLDS) == 4, 7, 0)
    sim.episodes.done.assign(done)
    turn(2)
    assert sim.episodes.done.numpy().tolist() == done.tolist()
    assert sim.episodes.step.numpy().tolist() == np.where(done, 20, 60).tolist()
    assert np.all(sim.state.position.numpy() != before)
    sim.reset(sim.episodes.done)
    turn(3)
    plain = ot.Simulation(lossy_scene(), worlds=2 * WORLDS, seed=31, device=device)
    plain.step(60)
    assert np.array_equal(sim.state.position.numpy()[4], plain.state.position.numpy()[4 + WORLDS])


def test_who_settles_is_said_when_it_is_captured(device):
    sim = ot.Simulation(lossy_scene(), worlds=WORLDS, device=device, ends=())
    sim.capture(20, settle=False)(3)
    assert not np.any(sim.episodes.step.numpy()) and sim.state.step == 60
    ending = ot.Simulation(lossy_scene(), worlds=WORLDS, device=device, ends=[ot.escaped])
    with pytest.raises(ot.InputError, match=r"settle is False; allowed: with ends=\(\), else True"):
        ending.capture(20, settle=False)


def test_what_cannot_be_captured(device):
    with pytest.raises(ot.InputError, match="has no episodes"):
        ot.Simulation(lossy_scene(), device=device).capture(10)
    sim = ot.Simulation(lossy_scene(), worlds=WORLDS, device=device, ends=())
    with pytest.raises(ot.InputError, match="steps is 0; allowed: 1 or more"):
        sim.capture(0)
    with pytest.raises(ot.InputError, match=r"steps is 10000000000; allowed: 1 to \d+ a turn.*loop\(turns\)$"):
        sim.capture(10**10)
    turn = sim.capture(5)
    sim.control.set(trap_position=np.zeros((WORLDS, 1, 3)))
    with pytest.raises(ot.InputError, match="has grown since the capture"):
        turn()


def test_a_readout_is_of_the_present_state_also_where_worlds_have_started_anew(device):
    sim = ot.Simulation(lossy_scene(), worlds=WORLDS, seed=31, device=device, ends=[ot.timed_out(after=0.0)])
    for after in (lambda: sim.reset(sim.episodes.done), None):
        turn = sim.capture(20, after=after, readout=True)
        seen = sim.readout.trap_distance.numpy().copy()
        assert np.array_equal(seen, sim.measure().trap_distance.numpy()), "the capture has measured nothing"
        turn()
        seen = sim.readout.trap_distance.numpy().copy()
        assert np.array_equal(seen, sim.measure().trap_distance.numpy())


@pytest.mark.parametrize(("captured", "most"), [(1, 100_000), (20_000, 200_000_000)])
def test_a_turn_has_as_many_steps_as_its_launches_can_be_recorded(captured, most):
    assert steps_of_turn(most, captured) == most
    with pytest.raises(ot.InputError, match=rf"steps is {most + 1}; allowed: 1 to {most} a turn"):
        steps_of_turn(most + 1, captured)


@pytest.mark.parametrize("turns", [-3, 2.5, "2"])
def test_turns_are_a_whole_number(turns, device):
    turn = ot.Simulation(lossy_scene(), worlds=WORLDS, device=device, ends=()).capture(5)
    with pytest.raises(ot.InputError, match=r"turns is .*; allowed: "):
        turn(turns)
