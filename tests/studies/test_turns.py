"""Batches that share a device: one takes its steps while the next is set up, to the bits of one after the other."""

from __future__ import annotations

import itertools
import shutil
import threading
from concurrent.futures import CancelledError

import pytest

from otwarp.errors import InputError
from otwarp.simulation.simulation import Simulation
from otwarp.studies.axes import grid
from otwarp.studies.engines import memory
from otwarp.studies.engines.local import batches_of, lanes_of, on_this_host, side_by_side
from otwarp.studies.engines.run import prepare
from otwarp.studies.observables import first_passage, trapped
from otwarp.studies.rare.study import EscapeStudy
from otwarp.studies.stopping.rules import half_width, trials
from otwarp.studies.study import Study
from otwarp.studies.turns import Turns
from tests.studies.scenes import bead_in_a_well

pytest.importorskip("zarr")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


def study_of(scene, stop=None) -> Study:
    """Six blocks of a point."""
    axes = {"trap_power": grid(0.2, 1.0, 6, unit="mW")}
    how = {"observables": [trapped(until=0.05), first_passage()], "stop": stop or trials(256), "seed": 3}
    return Study(scene, axes=axes, **how).in_blocks((1,))


def in_turn(study, folder, turns=None):
    """The store of a study that two threads compute on one device in turns."""
    store = prepare(study, folder)
    lanes = [("cpu", turns or Turns(2))] * 2
    done = list(side_by_side(study, store, [[n] for n in range(6)], lanes))
    assert sorted(done) == [[n] for n in range(6)]
    return store


@pytest.mark.parametrize("stop", [trials(256), half_width(0.05, at_least=16, at_most=256)], ids=["number", "width"])
def test_two_that_take_turns_give_the_bits_of_one(scene, tmp_path, monkeypatch, stop):
    """And each batch takes all of its steps before another one does."""
    study, took, step = study_of(scene, stop), [], Simulation.step
    one = prepare(study, tmp_path / "one")
    on_this_host(["cpu"])(study, one, range(6), lambda done, of: None)
    monkeypatch.setattr(Simulation, "step", lambda sim, *a, **how: took.append(id(sim)) or step(sim, *a, **how))
    assert in_turn(study, tmp_path / "two").read().load().identical(one.read().load())
    batches = len(list(itertools.groupby(took)))
    assert batches >= 6 and len(took) > 10 * batches


def test_the_next_is_set_up_while_one_takes_its_steps(scene):
    """Who waits for steps has been set up, and does not keep them."""
    study, turns = study_of(scene), Turns(2)
    waiting = threading.Event()
    took = turns.steps

    def steps():
        waiting.set()
        return took()

    turns.steps = steps  # type: ignore[method-assign]
    other = threading.Thread(target=study.compute, args=([0],), kwargs={"device": "cpu", "turns": turns})
    with took():
        other.start()
        assert waiting.wait(60.0)
        with turns.setup():  # that is over
            assert other.is_alive()
    other.join()


def test_an_error_ends_the_turns(scene, tmp_path):
    """What cannot be kept is one error, and who waits for a turn gives up instead of computing on."""
    study, turns = study_of(scene), Turns(2)
    store = prepare(study, tmp_path / "out")
    shutil.rmtree(store.results)
    with pytest.raises((InputError, OSError), match=r"results\.zarr"):
        list(side_by_side(study, store, [[n] for n in range(6)], [("cpu", turns)] * 2))
    for kind in (study, EscapeStudy(scene, runs=2, branches=64, relax=0.1, halved=False, seed=3)):
        with pytest.raises(CancelledError):
            kind.compute([0], device="cpu", turns=turns)


def test_lanes():
    """A GPU has two where there are two tasks for it, all GPUs a first one before one has a second; a core has one."""
    names = {
        count: [(device, turns.batches) for device, turns in lanes_of(["cuda:0", "cuda:1"], count)]
        for count in (1, 2, 3, 9)
    }
    assert names[1] == names[2] == [("cuda:0", 1), ("cuda:1", 1)]
    assert names[3] == names[9] == [("cuda:0", 2), ("cuda:1", 2)] * 2
    assert [device for device, _ in lanes_of(["cpu", "cpu"], 9)] == ["cpu", "cpu"]
    a, b = lanes_of(["cuda:0"], 2)
    assert a[1] is b[1]


def test_two_share_the_memory(scene, monkeypatch):
    """Together they have as many worlds as one alone; a study of one task leaves none of it to another."""
    study = study_of(scene)
    assert batches_of(study, gpu=True) == (1, 6 * 256) and batches_of(study, gpu=False) == (1, 256)
    larger = study_of(scene, trials(2**19))
    assert batches_of(larger, gpu=True) == (2, 2**20)
    each = memory.room_of(study, "cpu").each
    monkeypatch.setattr(memory, "free_bytes", lambda device: int(100 * each / memory.SHARE))
    assert [memory.worlds_at_once(study, "cpu", n) for n in (1, 2)] == [100, 50]
    plenty = memory.LARGEST * memory.ROUGHLY * memory.HOST * memory.world_bytes(study.design.scene, "float32")
    monkeypatch.setattr(memory, "free_bytes", lambda device: int(1.5 * plenty / memory.SHARE))
    assert memory.worlds_at_once(study, "cpu") == memory.LARGEST == memory.worlds_at_once(study, "cpu", 2)
