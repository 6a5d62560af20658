"""What tests of devices with a driver share: a clock for the age of forces, doubles, and a hand of the servo."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from otwarp.haptics.core import Device, SceneFrame
from otwarp.haptics.core.realtime import VirtualClock
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.servo.hand import REOPEN_AFTER, Hand
from otwarp.haptics.servo.link import HandLayout
from tests.haptics.libhd_double import compiled
from tests.haptics.spring import SpringChain

PATIENCE = 60.0
"""Seconds after which a test that waits for a thread fails; nothing is measured by it."""


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> str:
    return compiled(tmp_path_factory.mktemp("libhd"))


def ended(talker: Any) -> None:
    """Wait for the end of the thread that talks to the device."""
    talker._thread.join(PATIENCE)
    assert not talker._thread.is_alive()


class ServedHand:
    """The servo's own code for one hand with a device, on a virtual clock; a context manager.

    Args:
        device: Not opened.
        meanwhile: What the device does before each cycle.
    """

    def __init__(self, device: Device, meanwhile: Callable[[], None] = lambda: None):
        self._clock, self._box, self._meanwhile = VirtualClock(), Mailbox.create(HandLayout(1)), meanwhile
        self._hand = Hand(device, SpringChain, self._box)

    def __enter__(self) -> ServedHand:
        self._hand.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._hand.release(self._clock.now())
        self._box.close()

    @property
    def status(self) -> Any:
        return self._hand.status

    def run(self, cycles: int) -> None:
        for _ in range(cycles):
            self._meanwhile()
            self._hand.cycle(self._clock.now(), SceneFrame(1, 0.0, (), ()))
            self._clock.advance(0.001)

    def arm(self) -> None:
        """Arm it, and let its force rise."""
        self.run(2)
        self._hand.arm()
        self.run(5)

    def come_back(self) -> None:
        """Wait until the servo looks for a lost device again, and see that it has found it."""
        assert not self.status.present
        self._clock.advance(REOPEN_AFTER)
        self.run(4)
        assert self.status.present and "back" in self.status.message
