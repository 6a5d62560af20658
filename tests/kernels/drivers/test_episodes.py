"""Between launches: the list of the worlds in motion, their clocks, and how they start anew."""

import numpy as np
import warp as wp

import otwarp as ot
from otwarp.kernels.core.types import ReadoutData
from otwarp.kernels.drivers.episodes import (
    WorldFunction,
    end_code,
    list_living,
    outcomes,
    parameters_from,
    settle_kernel,
)
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import bead_scene

DONE = [0, 3, 0, 0, -1, 0]


def test_the_list_holds_the_worlds_in_motion(device):
    sim = Simulation(bead_scene(), worlds=len(DONE), device=device, ends=())
    sim.episodes.done.assign(DONE)
    sim.episodes.count.zero_()
    wp.launch(list_living, dim=len(DONE), inputs=[sim.model.data], device=device)
    count, left = sim.episodes.count.numpy()
    assert (count, left) == (4, 0)
    assert sorted(sim.episodes.living.numpy()[:count]) == [0, 2, 3, 5]


def test_clocks_turn_for_the_worlds_on_the_list_alone(device):
    sim = Simulation(bead_scene(), worlds=len(DONE), device=device, ends=())
    sim.episodes.done.assign(DONE)
    sim.episodes.list()
    sim.episodes.settle(9, len(DONE))
    assert sim.episodes.step.numpy().tolist() == [9, 0, 9, 9, 0, 9]
    assert sim.episodes.done.numpy().tolist() == DONE
    assert sim.episodes.count.numpy().tolist() == [4, 4]


def test_of_a_list_of_all_worlds_those_that_have_ended_are_left_alone(device):
    sim = Simulation(bead_scene(), worlds=len(DONE), device=device, ends=())
    sim.episodes.list_all()
    sim.episodes.done.assign(DONE)
    sim.episodes.settle(9, len(DONE))
    assert sim.episodes.step.numpy().tolist() == [9, 0, 9, 9, 0, 9]
    assert sim.episodes.done.numpy().tolist() == DONE
    assert sim.episodes.count.numpy().tolist() == [6, 4]


@wp.kernel
def tell_ends(readout: ReadoutData, found: wp.array(dtype=int), code: wp.array(dtype=int)):
    world = wp.tid()
    code[world] = end_code(readout, world, found[world])


def test_a_fault_of_any_body_comes_before_every_end(device):
    readout = ReadoutData()
    readout.fault = wp.array([[0, 0], [0, 0], [3, 0], [0, 1], [1, 1]], dtype=wp.int32, device=device)
    found, code = wp.array([0, 2, 0, 2, 1], dtype=int, device=device), wp.zeros(5, dtype=int, device=device)
    wp.launch(tell_ends, dim=5, inputs=[readout, found], outputs=[code], device=device)
    assert code.numpy().tolist() == [0, 2, -1, -1, -1]


def test_outcomes_are_told_to_the_step_of_an_escape_or_a_fault(device):
    """Where escapes end a world (their code is 2) the first one counts, but not after a fault; elsewhere none does."""
    done, lost = [0, 1, -1, 1, 2, -1], [[-1, -1], [-1, -1], [9, -1], [7, 4], [-1, 10], [-1, 4]]
    fault, when = [[0, 0], [0, 0], [3, 3], [0, 0], [0, 0], [0, 3]], [[0, 0], [0, 0], [8, 6], [0, 0], [0, 0], [0, 5]]
    given = ((done, wp.int32), ([10] * 6, wp.int64), (fault, wp.int32), (when, wp.int64), (lost, wp.int64))
    arrays = [wp.array(x, dtype=t, device=device) for x, t in given]
    wanted = ((2, [0, 1, -1, 2, 2, 2], [10, 10, 6, 4, 10, 4]), (0, done, [10, 10, 6, 10, 10, 5]))
    for escaped, codes, steps in wanted:
        code, time = wp.zeros(6, dtype=wp.int8, device=device), wp.zeros(6, dtype=wp.float64, device=device)
        wp.launch(outcomes, dim=6, inputs=[*arrays, escaped, wp.float64(0.1)], outputs=[code, time], device=device)
        assert code.numpy().tolist() == codes
        np.testing.assert_allclose(time.numpy(), 0.1 * np.array(steps), rtol=1e-15)


def test_parameters_are_read_from_the_columns_in_order():
    predicate = WorldFunction(abs, (float, wp.vec3, int))
    assert predicate.width == 5
    assert (
        parameters_from(predicate, 2)
        == ", (values[row, 2]), vec3(values[row, 3], values[row, 4], values[row, 5]), int(values[row, 6])"
    )


def test_equal_ends_share_a_kernel():
    predicates = (ot.escaped.predicate, ot.timed_out(after=1.0).predicate)
    assert settle_kernel(predicates) is settle_kernel((ot.escaped.predicate, ot.timed_out(after=np.ones(3)).predicate))
