"""Two hands in one session, each with its traps and its own axes."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.haptics.core.config import FACING_USER, HandConfig, HapticsConfig
from otwarp.teleop.operators.hands import plan_hands
from otwarp.teleop.operators.virtual_servo import LinkedClock, VirtualServo
from otwarp.teleop.session.live import LiveLoop
from tests.teleop.scenes import PLACES, three_beads

RATE = 120.0
TURNED = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""Scene x is the device's y, scene y its −x."""
TAKING_HOLD = 0.0081
"""Micrometres: a hand that is under way takes hold one or two servo periods late, 0.004 µm each."""
ALONG_X = "virtual:line,from=0/0/0,to=0.02/0/0,duration=0.5,mass=0"


def test_each_hand_moves_its_own_traps_by_its_own_axes():
    scene, clock = three_beads(), LinkedClock()
    hands = (HandConfig(name="left", axis_map=TURNED), HandConfig(name="right", axis_map=FACING_USER))
    plans = plan_hands(scene, {"left": ALONG_X, "right": ALONG_X}, config=HapticsConfig(hands=hands))
    loop = LiveLoop(
        scene,
        plans,
        make_servo=lambda plans, local: VirtualServo(clock, plans, local, len(scene.traps)),
        clock=clock,
        rate=RATE,
        device="cpu",
    )
    try:
        loop.start()
        for _ in range(round(RATE)):
            live = loop.tick()
            clock.sleep_until(clock.now() + 1.0 / RATE)
        moved = live.frame.trap_position[0] - np.array(list(PLACES.values()))
        # 0.02 m along the device's x at 100 µm/m: the right hand's x, the left hand's −y, and no other trap
        assert moved == pytest.approx(np.array([[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), abs=TAKING_HOLD)
    finally:
        loop.close()
