"""How long a run is, and what its frames and summary say of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.record.read import read_run
from otwarp.record.run import _missed_text, frame_steps, record_run
from otwarp.scene import Scene
from otwarp.simulation.options import StepOptions

SCENES = Path(__file__).parents[2] / "scenes"


@pytest.mark.parametrize(
    ("duration", "expected"),
    [(0.005, [50]), (0.01, [100]), (0.03, [167, 300]), (0.05, [167, 333, 500]), (1 / 60, [167])],
)
def test_frames_are_whole_but_for_the_last(duration: float, expected: list[int]) -> None:
    assert list(frame_steps(duration, 60.0, 1e-4)) == expected


@pytest.mark.parametrize("rate", [24.0, 29.97, 30.0, 60.0, 1000.0])
@pytest.mark.parametrize("time_step", [1e-4, 0.000112136526222292, 3.7e-5])
def test_a_run_goes_on_where_it_stopped(rate: float, time_step: float) -> None:
    whole = list(frame_steps(1.3, rate, time_step))
    assert whole[-1] == round(1.3 / time_step)
    assert len(whole) in (int(1.3 * rate), int(1.3 * rate) + 1)
    for first in (0, whole[0], whole[7], whole[7] + 1, whole[-1]):
        assert list(frame_steps(1.3, rate, time_step, first=first)) == [s for s in whole if s > first]


def test_a_run_lasts_as_long_as_it_was_asked_to(device: str, tmp_path: Path) -> None:
    scene = Scene.load(SCENES / "single_bead.usda", duration=0.03)
    summary = record_run(scene, tmp_path / "run", device=device, options=StepOptions(time_step=0.001))
    assert (summary["steps"], summary["frames"], summary["status"]) == (30, 3, "finished")
    assert summary["duration_s"] == pytest.approx(0.03)
    assert read_run(tmp_path / "run" / "run.nc").time == pytest.approx([0.0, 0.017, 0.03])


def test_a_run_shorter_than_a_step_is_refused(device: str, tmp_path: Path) -> None:
    scene = Scene.load(SCENES / "single_bead.usda", duration=4e-4)
    with pytest.raises(InputError, match=r"duration is 0\.0004 s; allowed: at least one time step, 0\.001 s"):
        record_run(scene, tmp_path / "run", device=device, options=StepOptions(time_step=0.001))
    assert not (tmp_path / "run").exists()


def test_the_reach_that_was_given_decides_what_an_escape_is(device: str, tmp_path: Path) -> None:
    scene = Scene.load(SCENES / "single_bead.usda", duration=0.05)
    reach = np.array([[10.0], [1e-4], [1e-4]])
    dark = np.array([[1.0], [1.0], [0.0]])  # mW; a dark trap holds nothing that could escape
    values = {"trap_cutoff": reach, "trap_axial_cutoff": reach, "trap_power": dark}
    options = StepOptions(time_step=1e-3, allow_large_step=True)
    summary = record_run(scene, tmp_path / "run", device=device, worlds=3, parameters=values, options=options)
    assert summary["escapes"] == 1
    assert summary["first_escape"]["world"] == 1
    # the bead is out of so short a reach after its first step or two, long before the first frame
    assert summary["first_escape"]["time_s"] < 0.01
    assert "in world 1" in summary["warnings"][-1]
    assert "contact_force" not in summary and "contact force" not in summary["text"]


def test_errors_that_no_step_mends_are_not_told_twice() -> None:
    gaps = _missed_text({"contact": 0.11}, 0.01)
    assert "no affordable time step mends" in gaps and "11 %" not in gaps
    assert "1 % in stationary variances in traps +3 %" in _missed_text({"variance": 0.03, "contact": 0.11}, 0.01)
