"""How long a state takes to the page."""

from __future__ import annotations

import pytest

pytest.importorskip("viser")

from otwarp.errors import InputError
from otwarp.teleop.page import measure
from otwarp.teleop.page.measure import measure_page


def test_frames_are_handed_on_and_a_program_that_is_no_browser_does_not_answer(monkeypatch):
    monkeypatch.setattr(measure, "LOAD_WITHIN", 1.0)
    found = measure_page(0.5, browser="true")
    assert found.frames >= 1 and 0.0 < found.applied[0] <= found.applied[1]
    assert found.answers == 0 and found.delay is None and found.browser == "true: did not answer"


def test_a_browser_that_is_not_there_is_refused():
    with pytest.raises(InputError, match=r"--browser is 'netscape'; allowed: a program that is there"):
        measure_page(0.5, browser="netscape")
