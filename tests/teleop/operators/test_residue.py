"""What a session says of a force when its servo is gone: zero only where that is known."""

from __future__ import annotations

import signal
import time

import pytest

from otwarp.haptics.core import ZERO, ServoFrame
from otwarp.haptics.core.config import HandConfig
from otwarp.haptics.devices import parse_devices
from otwarp.haptics.servo.guard import STANDS, SideReport, residue
from otwarp.haptics.servo.link import HandStatus, ServoStatus
from otwarp.teleop.operators import HandPlan
from otwarp.teleop.operators.hands import Hands

KILLED = -signal.SIGKILL
FELT = (1.3, 0.0, 0.0)


def status(state: str = "running") -> ServoStatus:
    return ServoStatus(900, 0.9, state, 0, 0.0, 0, 0, (HandStatus(True),))


def frame(age: float = 0.0) -> ServoFrame:
    return ServoFrame(900, time.perf_counter() - age, ZERO, FELT, ((0, ZERO),), "armed", 0.0)


class Gone:
    """A servo as its parent sees it once its process has ended, or stands still."""

    def __init__(self, device: str, code: int | None, watch: SideReport | None = None, state: str = "running"):
        (self.spec,) = parse_devices([device])
        self.code, self.watch, self.state = code, watch, state
        self.alive = code is None

    def status(self):
        return status(self.state)

    def hand(self, n):
        return frame(age=2.0)

    def residue(self, n):
        return residue(self.spec, self.code, self.status(), self.hand(n), self.watch)


@pytest.mark.parametrize(
    ("device", "code", "watch", "zero", "says"),
    [
        ("virtual:hold", KILLED, None, True, "the servo was killed (SIGKILL), nothing is felt; start the session anew"),
        ("ros1:/a", KILLED, SideReport(1, 3), True, "killed (SIGKILL), the guardian has sent zero force; start"),
        ("ros1:/a", KILLED, SideReport(1, 0), False, "zero force is not sent: it may push still, switch it off; start"),
        (
            "ros1:/a",
            KILLED,
            SideReport(0, 2, "nobody listens"),
            False,
            "zero force is not sent (nobody listens): it may",
        ),
        ("dualsense", None, SideReport(1, 5), True, "the servo stands still, the guardian has sent zero force"),
        ("openhaptics", KILLED, None, False, "whether its motors are off is for the device to say: hold it"),
        ("forcedimension", 1, None, False, "the servo ended with 1, and with it its driver"),
    ],
)
def test_a_force_is_shown_as_zero_only_where_it_is_known_to_be(device, code, watch, zero, says):
    hands = Hands([HandPlan(device, HandConfig(traps=(0,)))], Gone(device, code, watch))
    hands.listen()
    (shown,) = hands.frames
    assert shown.force == (ZERO if zero else FELT)
    assert says in shown.message and "\n" not in shown.message
    assert not shown.present and hands.died == (code is not None)


def test_one_that_ended_in_order_is_zero_whatever_the_device():
    for device in ("virtual:hold", "ros1:/a", "openhaptics"):
        found = Gone(device, 0, None, "stopped").residue(0)
        assert found.zero and found.message == "the servo has ended, nothing is felt any more; start the session anew"


def test_a_servo_that_runs_has_none():
    (spec,) = parse_devices(["ros1:/a"])
    assert residue(spec, None, status(), frame(), SideReport(1)) is None
    assert residue(spec, None, status(), frame(0.5 * STANDS), SideReport(1)) is None
    assert residue(spec, None, status("starting"), None, None) is None
