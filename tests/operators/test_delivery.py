"""A whole delivery by an operator who makes no mistake: the task can be done by these hands."""

from otwarp.operators.task import REACHED
from tests.operators.work import PERFECT, loop_of, operators


def test_a_perfect_operator_without_haptics_delivers(device):
    loop = loop_of(operators(1, **PERFECT), device=device)
    loop.run(14.0)
    assert loop.sim.episodes.done.numpy().tolist() == [REACHED]
