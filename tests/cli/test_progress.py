"""Lines of a log that say how far a job is: none of a short one that is asked to be quiet."""

from __future__ import annotations

import pytest

from otwarp.cli import progress

pytestmark = pytest.mark.quick


def lines(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], times: list[float], **how) -> list[str]:
    """What is said of a job of which a part is done at each of these times [s], the first when it begins."""
    clock = iter(times)
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    with progress.parts("step", "steps", **how) as update:
        for n in range(1, len(times)):
            update(n, len(times) - 1)
    return [line.split(",")[0] for line in capsys.readouterr().err.splitlines()]


def test_a_short_job_is_done_without_a_word(monkeypatch, capsys) -> None:
    assert lines(monkeypatch, capsys, [0.0, 0.1, 0.2, 1.9], after=progress.LONG) == []
    assert lines(monkeypatch, capsys, [0.0, 0.1, 0.2]) == ["otwarp: step 1 of 2", "otwarp: step 2 of 2"]


def test_a_long_job_says_how_far_it_is(monkeypatch, capsys) -> None:
    said = lines(monkeypatch, capsys, [0.0, 0.1, 2.5, 2.6, 2.7, 40.0], after=progress.LONG)
    assert said == ["otwarp: step 2 of 5", "otwarp: step 5 of 5"]
