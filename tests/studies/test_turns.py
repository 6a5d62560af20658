"""Batches that share a device: one takes its steps while the next is set up, to the bits of one after the other."""

from __future__ import annotations

import itertools
import shutil
import threading
from concurrent.futures import CancelledError

import pytest

from otwarp.errors import InputError
from otwarp.simulation.simulation import Simulation
from otwarp.studies.axes import grid, values
from otwarp.studies.engines import local, memory
from otwarp.studies.engines.local import on_this_host, side_by_side, tasks, tasks_at_once, trials_at_once
from otwarp.studies.engines.run import prepare
from otwarp.studies.observables import first_passage, trapped
from otwarp.studies.rare.study import EscapeStudy
from otwarp.studies.stopping.rules import half_width, trials
from otwarp.studies.store import Store
from otwarp.studies.study import Study
from otwarp.studies.turns import Turns
from tests.studies.scenes import bead_in_a_well

pytest.importorskip("zarr")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


def study_of(scene, stop=None, **more) -> Study:
    """Six blocks of a point."""
    axes = {"trap_power": grid(0.2, 1.0, 6, unit="mW"), **more}
    how = {"observables": [trapped(until=0.05), first_passage()], "stop": stop or trials(256), "seed": 3}
    return Study(scene, axes=axes, **how).in_blocks((1,) * (1 + len(more)))


@pytest.mark.parametrize("stop", [trials(256), half_width(0.05, at_least=16, at_most=256)], ids=["number", "width"])
def test_two_that_take_turns_give_the_bits_of_one(scene, tmp_path, monkeypatch, stop):
    """And each batch takes all of its steps before another one does."""
    study, took, step = study_of(scene, stop), [], Simulation.step
    one, two = prepare(study, tmp_path / "one"), prepare(study, tmp_path / "two")
    on_this_host(["cpu"])(study, one, range(6), lambda done, of: None)
    monkeypatch.setattr(Simulation, "step", lambda sim, *a, **how: took.append(id(sim)) or step(sim, *a, **how))
    done = list(side_by_side(study, two, [[n] for n in range(6)], [("cpu", Turns())] * 2))
    assert sorted(done) == [[n] for n in range(6)]
    assert two.read().load().identical(one.read().load())
    batches = len(list(itertools.groupby(took)))
    assert batches >= 6 and len(took) > 10 * batches


def test_the_next_is_set_up_while_one_takes_its_steps(scene):
    """Who waits for steps has been set up, and does not keep others from that."""
    study, turns = study_of(scene), Turns()
    waiting, took = threading.Event(), turns.steps

    def steps():
        waiting.set()
        return took()

    turns.steps = steps  # type: ignore[method-assign]
    other = threading.Thread(target=study.compute, args=([0],), kwargs={"device": "cpu", "turns": turns})
    with took():
        other.start()
        assert waiting.wait(60.0)
        with turns.setup():
            assert other.is_alive()
    other.join()


def test_an_error_ends_the_turns(scene, tmp_path):
    """What cannot be kept is one error, and who waits for a turn gives up instead of computing on."""
    study, turns = study_of(scene), Turns()
    store = prepare(study, tmp_path / "out")
    shutil.rmtree(store.results)
    with pytest.raises((InputError, OSError), match=r"results\.zarr"):
        list(side_by_side(study, store, [[n] for n in range(6)], [("cpu", turns)] * 2))
    for kind in (study, EscapeStudy(scene, runs=2, branches=64, relax=0.1, halved=False, seed=3)):
        with pytest.raises(CancelledError):
            kind.compute([0], device="cpu", turns=turns)


def test_a_folder_that_cannot_be_made(scene, tmp_path):
    """Steps are taken while the folder is made: that it cannot be is one error, and no more is computed than a look."""
    study, taken = study_of(scene), []
    study.compute = lambda *a, **how: taken.append(Study.compute(study, *a, **how))  # type: ignore[method-assign]

    def begin() -> None:
        raise InputError("no room")

    with pytest.raises(InputError, match="no room"):
        on_this_host(["cpu", "cpu"], begin)(study, Store(tmp_path / "out"), range(6), lambda done, of: None)
    assert len(taken) <= 2 and not (tmp_path / "out").exists()


def test_who_shares_a_device(scene, monkeypatch):
    """Where no steps are captured as graphs: of bodies that do not touch, in one model, and with plenty of memory."""
    monkeypatch.setattr(local, "has_plenty", lambda study, device, batches: True)
    study = study_of(scene)
    assert tasks_at_once(study, "cuda:0") == 2 and tasks_at_once(study, "cpu") == 1
    assert tasks_at_once(study_of(scene, **{"/World/bead/sphere.radius": values([0.4], unit="µm")}), "cuda:0") == 1
    assert tasks_at_once(EscapeStudy(scene, runs=2, branches=64, relax=0.1, halved=False, seed=3), "cuda:0") == 1
    delivery = Study("scenes/cell_delivery.usda", observables=[trapped(until=0.01)], stop=trials(1))
    assert tasks_at_once(delivery, "cuda:0") == 1
    monkeypatch.setattr(local, "has_plenty", lambda study, device, batches: False)
    assert tasks_at_once(study, "cuda:0") == 1


def test_two_have_as_many_trials_as_one(scene, monkeypatch):
    """Two at once share what a GPU has at once, and the memory: only where both surely fit."""
    study = study_of(scene, trials(2**18))
    todo = range(6)
    assert [len(t) for t in tasks(study, todo, gpu=True)] == [4, 2]
    assert [len(t) for t in tasks(study, todo, gpu=True, at_once=2)] == [2, 2, 2]
    monkeypatch.setattr(local, "has_plenty", lambda study, device, batches: True)
    assert trials_at_once(study, "cuda:0") == 2**20 and trials_at_once(study, "cpu") == 2**18
    plenty = memory.LARGEST * memory.ROUGHLY * memory.HOST * memory.world_bytes(study.design.scene, "float32")
    monkeypatch.setattr(memory, "free_bytes", lambda device: int(1.5 * plenty / memory.SHARE))
    assert memory.has_plenty(study, "cpu") and not memory.has_plenty(study, "cpu", 2)
