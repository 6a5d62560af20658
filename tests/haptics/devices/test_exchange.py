"""Where the servo's thread meets a driver's: forces fade with their age and never grow; the newest is sent alone."""

from __future__ import annotations

import math
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from otwarp.haptics.core import ZERO
from otwarp.haptics.devices.exchange import GONE, HOLD, Exchange, LatestSender, share
from tests.haptics.devices.conftest import Clock


@given(st.floats(-1.0, 1e3))
def test_the_share_of_a_force_never_grows(age):
    assert 0.0 <= share(age + 1e-3) <= share(age) <= 1.0
    assert (share(age) == 1.0) == (age <= HOLD)
    assert (share(age) == 0.0) == (age >= GONE)


@given(
    force=st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 3), age=st.floats(-1e3, 1e3, allow_nan=False)
)
def test_an_exchange_never_renders_more_than_was_written(force, age):
    clock = Clock()
    exchange = Exchange("it", clock)
    exchange.write(force)
    clock.now = age
    got = exchange.force()
    for component, written in zip(got, force, strict=True):
        assert math.isfinite(component) and (abs(component) <= abs(written) or component == 0.0)
    exchange.lose("gone")
    assert exchange.force() == ZERO


def test_a_sender_skips_what_the_kernel_has_no_room_for_and_stops_at_an_error():
    sent, refuse = [], [BlockingIOError(11, "full")]

    def send(item):
        if refuse:
            raise refuse.pop()
        sent.append(item)

    ended = []
    sender = LatestSender(send, lambda: ended.append(True))
    sender.put(1)
    sender.close(2)
    assert ended == [True]
    assert sent in ([2], [])  # 1 was refused, or replaced by 2 and that refused


def test_after_an_error_a_sender_sends_no_more_and_ends_when_told():
    tried, failed, ended = [], threading.Event(), []

    def send(item):
        tried.append(item)
        raise OSError(19, "gone")

    class Sender(LatestSender):
        def _empty(self):
            super()._empty()
            failed.set()

    broken = Sender(send, lambda: ended.append(True))
    broken.put(1)
    assert failed.wait(30.0)
    with pytest.raises(OSError, match="gone"):
        broken.put(2)
    assert ended == []
    broken.close(3)
    assert (tried, ended) == ([1], [True])
