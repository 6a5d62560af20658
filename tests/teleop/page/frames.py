"""Frames made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from otwarp.teleop import PaceNow
from otwarp.teleop.page.protocol import PageFrame, TrapDrawing


def page_frame(traps: Any = (), bodies: int = 0, **more: Any) -> PageFrame:
    """A frame with traps at these places and bodies at the origin."""
    place = np.asarray(traps, dtype=np.float32).reshape(-1, 3)
    n = len(place)
    values: dict[str, Any] = {
        "stamp": 0.0,
        "beat": 1,
        "time": 0.0,
        "position": np.zeros((bodies, 3), dtype=np.float32),
        "orientation": np.tile(np.array([0, 0, 0, 1], dtype=np.float32), (bodies, 1)),
        "trap_position": place,
        "trap_power": np.ones(n, dtype=np.float32),
        "trap_force": np.zeros((n, 3), dtype=np.float32),
        "trap_distance": np.zeros(n, dtype=np.float32),
        "contact_force": np.zeros((bodies, 3), dtype=np.float32),
        "contact_load": np.zeros(bodies, dtype=np.float32),
        "hand_force": np.zeros((2, 3), dtype=np.float32),
        "hands": (),
        "servo": None,
        "pace": PaceNow(),
        "warnings": (),
        "task": "",
        "recording": None,
    }
    return PageFrame(**(values | more))


def trap(hand: str = "none", position: Any = (0.0, 0.0, 0.0), **more: Any) -> TrapDrawing:
    """A trap as drawn."""
    rest: dict[str, Any] = {"name": "t", "power": 5.0, "orientation": (0, 0, 0, 1), "colour": (255, 0, 0), "reach": 2.0}
    return TrapDrawing(hand=hand, position=tuple(position), **(rest | more))
