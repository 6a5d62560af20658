"""Recorded sessions as a source of the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import otwarp as ot
from otwarp.cli.main import EXIT_BAD_INPUT, main
from otwarp.view.curves import charts
from otwarp.view.session import SessionSource
from tests.view.runs import PEAK, PEAK_AT, RATE, SCENE, frames
from tests.view.sessions import COUNT, session

pytest.importorskip("rosbags")


def test_a_session_has_its_moments(tmp_path: Path):
    scene = ot.Scene.load(SCENE)
    session(tmp_path / "take.mcap", scene)
    found = SessionSource(tmp_path / "take.mcap")
    wanted = frames(scene, COUNT)[PEAK_AT]
    frame = found.frame(PEAK_AT)
    assert frame.time == pytest.approx(PEAK_AT / RATE)
    for name in ("position", "orientation", "trap_position", "trap_power", "contact_load"):
        np.testing.assert_allclose(getattr(frame, name), getattr(wanted, name)[0], rtol=1e-6, atol=1e-6)
    assert found.held.tolist() == [0, 0, 0, 1, 1, 1]
    assert found.moments(slice(70, 80)).position.shape == (10, 3, 3)
    load = next(chart for chart in charts(found) if chart.key == "load")
    assert np.nanmax(load.values) == pytest.approx(PEAK)
    assert dict(found.about)["devices"] == "none"
    assert dict(found.about)["time shown"] == "that of the session's clock"


def test_a_session_has_one_world(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    session(tmp_path / "take.mcap", ot.Scene.load(SCENE))
    assert main(["view", str(tmp_path / "take.mcap"), "--world", "1", "--no-open"]) == EXIT_BAD_INPUT
    assert "allowed: 0, the only one" in capsys.readouterr().err
