"""Worlds with clocks of their own, as the kernels see them."""

from otwarp.simulation.packing.arrays import Place
from otwarp.simulation.packing.worlds import pack_worlds


def test_each_world_starts_with_the_trial_of_its_number(device):
    _, (data,) = pack_worlds(3, 5, Place(device))
    assert data.number.numpy().tolist() == [5, 6, 7]
    assert data.living.numpy().tolist() == [0, 1, 2]
    assert data.count.numpy().tolist() == [3, 3]
    assert not data.step.numpy().any() and not data.done.numpy().any()


def test_without_worlds_there_is_nothing(device):
    array, kept = pack_worlds(0, 0, Place(device))
    assert array.size == 0 and kept == []
