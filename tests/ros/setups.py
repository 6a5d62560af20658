"""A live loop on a virtual clock, and what ROS knows of its scene."""

from __future__ import annotations

from otwarp.haptics.core.realtime import VirtualClock
from otwarp.ros.roles import Roles
from otwarp.teleop import LiveFrame
from otwarp.teleop.session.live import LiveLoop

RATE = 60.0
"""Of the loops [Hz]."""


def roles_of(loop: LiveLoop, pairing: str = "release") -> Roles:
    model = loop.sim.model
    return Roles.of(model.scene, model.held, pairing)


def run(loop: LiveLoop, clock: VirtualClock, seconds: float) -> LiveFrame:
    """Turns of a loop for so long; its last frame."""
    live = None
    for _ in range(round(seconds * RATE)):
        live = loop.tick()
        clock.advance(1.0 / RATE)
    assert live is not None
    return live
