"""A device is given trials before those that it was given last are read."""

from __future__ import annotations

import threading
from concurrent.futures import CancelledError
from pathlib import Path

import numpy as np
import pytest
import warp as wp

import otwarp as ot
from otwarp.device import reading
from otwarp.studies import compute
from otwarp.studies.engines.local import on_this_host
from otwarp.studies.engines.run import run_study
from otwarp.studies.file import load_study
from otwarp.studies.runner import Runner
from otwarp.studies.store import open_store
from tests.studies.scenes import bead_in_a_well, study_of_a_well

pytest.importorskip("zarr")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A study, and its scene."""
    place = tmp_path_factory.mktemp("study")
    bead_in_a_well(place)
    (place / "s.toml").write_text(study_of_a_well(12, 64))
    return place


@pytest.mark.parametrize(
    ("room", "order"),
    [(2**20, ["start", "start", "read", "start", "read", "read"]), (700, ["start", "read"] * 3)],
)
def test_the_next_trials_start_before_the_last_are_read_where_there_is_room(folder, monkeypatch, room, order):
    """Three radii, each a model of its own; with little memory one after the other. Results are the same."""
    study = ot.Study(
        folder / "well.usda",
        axes={"/World/bead/sphere.radius": ot.studies.values([0.4, 0.5, 0.6], unit="µm")},
        observables=[ot.trapped(until=0.1)],
        stop=ot.trials(200),
    )
    found = study.compute(range(len(study.blocks())), device="cpu")
    happened = []
    start = Runner.start

    def told(self, *a, **how):
        happened.append("start")
        read = start(self, *a, **how)

        def reading():
            happened.append("read")
            return read()

        return reading

    monkeypatch.setattr(Runner, "start", told)
    monkeypatch.setattr(compute, "worlds_at_once", lambda study, device: room)
    read = study.start(range(len(study.blocks())), device="cpu")
    assert happened == order[: 5 if room == 2**20 else 6]
    again = read()
    assert happened == order
    for one, other in zip(found, again, strict=True):
        assert all(np.array_equal(one[name], other[name], equal_nan=one[name].dtype.kind == "f") for name in one)


def test_what_fails_while_it_is_read_ends_the_run_and_keeps_the_rest(folder, tmp_path, monkeypatch):
    study = load_study(folder / "s.toml").in_blocks((2, 4))
    start = type(study).start

    def failing(self, numbers, **how):
        read = start(self, numbers, **how)
        return read if 3 not in numbers else lambda: 1 // 0

    with monkeypatch.context() as patch:
        patch.setattr(type(study), "start", failing)
        with pytest.raises(ZeroDivisionError):
            run_study(study, tmp_path / "out", engine=on_this_host(["cpu", "cpu"]))
    assert 3 not in (done := open_store(tmp_path / "out").finished()) and done
    store, whole = (run_study(study, tmp_path / name, devices=["cpu"]) for name in ("out", "whole"))
    assert len(store.finished()) == 6
    assert store.read().load().identical(whole.read().load())


def test_a_device_may_be_given_more_before_arrays_are_read(device):
    """What was launched before counts, however much is launched behind it."""
    place = wp.get_device(device)
    ones, other = (wp.zeros(2**16, dtype=wp.float32, device=place) for _ in range(2))
    for _ in range(100):
        wp.launch(add_one, dim=len(ones), inputs=[ones], device=place)
    read = reading([ones], place)
    for _ in range(1_000):
        wp.launch(add_one, dim=len(other), inputs=[other], device=place)
    (found,) = read()
    assert np.all(found == 100.0) and np.all(other.numpy() == 1_000.0)


@wp.kernel(enable_backward=False)
def add_one(values: wp.array(dtype=wp.float32)):
    values[wp.tid()] += 1.0


def test_what_ends_a_run_ends_its_threads(folder, tmp_path, monkeypatch):
    """An interrupt that comes in `progress`, as of the command: no thread goes on behind, and none is waited for."""
    study = load_study(folder / "s.toml").in_blocks((2, 4))
    start, freed = type(study).start, []

    def endless(self, numbers, *, unwanted, **how):
        if 0 not in numbers:
            freed.append(unwanted.wait(60.0))
        return start(self, numbers, unwanted=unwanted, **how)

    def interrupted(done: int, of: int) -> None:
        if done:
            raise KeyboardInterrupt

    monkeypatch.setattr(type(study), "start", endless)
    with pytest.raises(KeyboardInterrupt):
        run_study(study, tmp_path / "out", engine=on_this_host(["cpu", "cpu"]), progress=interrupted)
    assert not [thread.name for thread in threading.enumerate() if thread.name.startswith("study-")]
    assert freed and all(freed) and open_store(tmp_path / "out").finished() == [0]


def test_trials_that_are_not_wanted_any_more_take_no_steps(folder):
    asked_to_end = threading.Event()
    asked_to_end.set()
    with pytest.raises(CancelledError):
        load_study(folder / "s.toml").start([0], device="cpu", unwanted=asked_to_end)
