"""The loop goes on at the speed that its steering says."""

from __future__ import annotations

from otwarp.haptics.core.realtime import VirtualClock
from otwarp.teleop.session.live import LiveLoop
from tests.teleop.scenes import three_beads


def test_the_speed_follows_what_steers_it():
    clock, asked = VirtualClock(), []

    def steer(now, pace):
        asked.append((now, pace.speed))
        return 0.5 if len(asked) == 10 else None

    loop = LiveLoop(three_beads(), clock=clock, rate=60.0, device="cpu", steer=steer)
    loop.start()
    for _ in range(20):
        live = loop.tick()
        clock.advance(1.0 / 60.0)
    assert live.pace.speed == 0.5
    assert [speed for _, speed in asked] == [1.0] * 10 + [0.5] * 10
    assert [now for now, _ in asked] == sorted(now for now, _ in asked)
    loop.close()
