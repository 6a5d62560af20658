"""What hands cost, in the budget of a session: traps that move are put anew every millisecond."""

from __future__ import annotations

import itertools

import pytest

from otwarp.simulation.simulation import Simulation
from otwarp.simulation.state import Control
from otwarp.teleop import session
from otwarp.teleop.budget.report import BATCHES, measure_scene
from otwarp.teleop.session import Session, SessionOptions
from otwarp.teleop.session.live import GLIDE
from tests.teleop.scenes import three_beads


@pytest.fixture
def calls(monkeypatch):
    """Steps of each launch, and None for each time that traps are put somewhere."""
    found: list[int | None] = []
    put, step = Control.set, Simulation.step

    def put_and_tell(self, **what):
        found.append(None)
        put(self, **what)

    def step_and_tell(self, steps=1):
        found.append(steps)
        step(self, steps)

    monkeypatch.setattr(Control, "set", put_and_tell)
    monkeypatch.setattr(Simulation, "step", step_and_tell)
    return found


@pytest.mark.thorough
def test_a_scene_with_hands_is_measured_with_traps_that_move(calls):
    ticks = itertools.count()
    clock = lambda: float(next(ticks))  # noqa: E731 - every reading a second later: one frame per batch
    measure_scene(three_beads(), device="cpu", rate=120.0, clock=clock)
    assert calls == [1] + [8] * BATCHES
    calls.clear()
    measure_scene(three_beads(), device="cpu", rate=120.0, clock=clock, glide=GLIDE)
    assert calls == [1] + [None, 1] * 8 * BATCHES
    calls.clear()
    measure_scene(three_beads(), device="cpu", rate=120.0, clock=clock, glide=3e-3)
    assert calls == [1] + [None, 3, None, 3, None, 2] * BATCHES
    calls.clear()
    measure_scene(three_beads(traps=()), device="cpu", rate=120.0, clock=clock, glide=GLIDE)
    assert calls == [1] + [8] * BATCHES


@pytest.mark.parametrize("devices", [{}, {"left": "virtual:hold,at=0/0/0"}])
def test_a_session_asks_for_it_if_it_has_hands(monkeypatch, devices):
    asked = []
    reduce = session.reduce_scene
    monkeypatch.setattr(session, "reduce_scene", lambda *a, **k: asked.append(k["measure"]) or reduce(*a, **k))
    options = SessionOptions(devices=devices, budget="1.0", duration=0.1, device="cpu")
    Session(three_beads(), options, say=lambda line: None).loop.close()
    assert asked[0].keywords == {"glide": GLIDE if devices else None}
