"""A trial of a study, run again by itself: the end that the study recorded, and frames of the same bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.studies.engines.run import run_study
from otwarp.studies.file import load_study
from otwarp.studies.rerun import rerun, stored_study
from otwarp.studies.store import Store, open_store
from tests.studies.scenes import bead_in_a_well

pytest.importorskip("zarr")

FILE = """
scene = "well.usda"
seed = 3
[[axis]]
name = "trap_power"
grid = { from = 0.2, to = 1, count = 2 }
unit = "mW"
[[axis]]
name = "start.x:/World/bead"
values = [0, 0.3]
unit = "µm"
[[observable]]
kind = "trapped"
until = "0.1 s"
[stop]
trials = 24
"""


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Of a study whose own files are gone."""
    folder = tmp_path_factory.mktemp("rerun")
    scene = bead_in_a_well(folder)
    file = folder / "study.toml"
    file.write_text(FILE.replace("well.usda", scene.name), encoding="utf-8")
    run_study(load_study(file), folder / "out", devices=["cpu"])
    file.unlink()
    scene.unlink()
    return open_store(folder / "out")


def test_trials_end_as_the_study_says_that_they_did(store: Store):
    study = stored_study(store)
    with store.read() as raw:
        code, time = raw["end"].values, raw["end_time"].values
    lost = [tuple(int(i) for i in at) for at in np.argwhere(code == 1)]
    held = [tuple(int(i) for i in at) for at in np.argwhere(code == 0)]
    assert len(lost) > 3 and len(held) > 3
    for a, b, trial in (*lost[::11], held[0]):
        found = rerun(store, study, 2 * a + b, trial)
        assert found.same and found.code == code[a, b, trial] and np.float32(found.time) == time[a, b, trial]
        assert found.frames[0].position[0, 0, 0] == pytest.approx((0.0, 0.3)[b], abs=1e-6)
        for frame in (found.frames[0], found.frames[-1]):
            away = np.linalg.norm(frame.position[0, 0] - frame.trap_position[0, 0])
            assert frame.trap_distance[0, 0] == pytest.approx(away, abs=1e-5)  # of the same moment
        ends = found.time if found.code else study.horizon
        assert found.frames[-1].time == pytest.approx(ends, abs=study.runner.time_step)
        assert found.held.tolist() == [0] and ("lost" in found.end or "escaped" in found.end) == (found.code == 1)


def test_what_differs_from_the_recorded_trial_is_said(store: Store, monkeypatch: pytest.MonkeyPatch):
    study = stored_study(store)
    assert rerun(store, study, 0, 0).same
    real = Store.read

    def other(self: Store):
        found = real(self)
        found["end_time"].values = found["end_time"].values + np.float32(1e-3)
        return found

    monkeypatch.setattr(Store, "read", other)
    assert not rerun(store, study, 0, 0).same


def test_what_is_not_there_is_refused(store: Store, tmp_path: Path):
    study = stored_study(store)
    with pytest.raises(InputError, match="point = 4; allowed: 0 … 3"):
        rerun(store, study, 4, 0)
    with pytest.raises(InputError, match="trial = 24 of point 1; allowed: 0 … 23"):
        rerun(store, study, 1, 24)
    text = (store.folder / "study.toml").read_text(encoding="utf-8")
    try:
        (store.folder / "study.toml").write_text(text.replace("seed = 3", "seed = 4"), encoding="utf-8")
        with pytest.raises(InputError, match="another seed"):
            stored_study(store)
        (store.folder / "study.toml").unlink()
        with pytest.raises(InputError, match="was described in Python"):
            stored_study(store)
    finally:
        (store.folder / "study.toml").write_text(text, encoding="utf-8")
