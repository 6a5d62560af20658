"""Memory of the world driver: no more than a scene needs, and threads for few worlds."""

import dataclasses
from types import SimpleNamespace

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.simulation.drivers.world_scratch import allocate_world, keeps_contacts, spread_of, team_for
from otwarp.simulation.packing.arrays import Place

GPU = SimpleNamespace(is_cuda=True, sm_count=132)


def test_few_worlds_are_spread():
    """Up to one thread of a warp, while a GPU has room for as many threads; never on a CPU."""
    assert [spread_of(worlds, GPU) for worlds in (1, 1_024, 2_048, 16_384, 131_072)] == [32, 32, 16, 2, 1]
    assert spread_of(1, wp.get_device("cpu")) == 1


def test_few_worlds_have_teams():
    """In phases, larger ones the fewer worlds there are; none where rods collide, in one kernel, and on a CPU."""
    f = Features(driver="world", bodies=3, pairs=True, rigid=True, phased=True)
    assert [team_for(f, worlds, GPU) for worlds in (1, 1_024, 4_096, 16_384)] == [16, 16, 8, 1]
    for other in (dataclasses.replace(f, rods=True), dataclasses.replace(f, phased=False)):
        assert team_for(other, 1, GPU) == 1
    assert team_for(f, 1, wp.get_device("cpu")) == 1


def test_many_worlds_of_few_contacts_keep_them():
    """Where they are solved for forces, on a GPU that is full; then the scratch has nothing."""
    f = Features(driver="world", obstacles=("plane",), max_contacts=4)
    assert [keeps_contacts(f, worlds, GPU) for worlds in (1, 16_384, 131_072)] == [False, False, True]
    for other in (
        dataclasses.replace(f, body_space=True),
        dataclasses.replace(f, max_contacts=5),
        dataclasses.replace(f, obstacles=()),
        dataclasses.replace(f, phased=True),
    ):
        assert not keeps_contacts(other, 131_072, GPU)
    assert not keeps_contacts(f, 131_072, wp.get_device("cpu"))
    kept = allocate_world(dataclasses.replace(f, keeps=True), 3, Place(wp.get_device("cpu")))
    assert kept.whole.size == kept.matrix.size == 0


def test_scratch_has_what_the_solver_reads(device):
    """Solved for moves: fields, and no matrix. For forces: records, and a matrix."""
    place = Place(wp.get_device(device))
    f = Features(driver="world", bodies=2, pairs=True, obstacles=("plane",), max_contacts=8, body_space=True)
    moves = allocate_world(f, 3, place)
    assert moves.face.shape == (3, 8) and moves.matrix.size == moves.whole.size == moves.ridge.size == 0
    forces = allocate_world(Features(driver="world", bodies=2, pairs=True, max_contacts=8), 3, place)
    assert forces.whole.shape == (3, 8) and forces.matrix.shape == (3, 64) and forces.face.size == 0
    nothing = allocate_world(Features(driver="world"), 3, place)
    assert nothing.whole.size == nothing.face.size == 0
    # neighbouring worlds side by side
    assert moves.face.strides[0] == 16
