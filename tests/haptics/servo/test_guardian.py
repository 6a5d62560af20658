"""What a driver is left with when processes are killed or stopped for real: zero force, whoever dies."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from otwarp.haptics.core import ZERO, ServoFrame
from otwarp.haptics.core.realtime import process_ended
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.devices import KINDS
from otwarp.haptics.servo.guardian import GuardedSide
from otwarp.haptics.servo.link import HandLayout, HandSetup
from otwarp.haptics.servo.process import ServoProcess
from tests.haptics.drivers import DRIVERS, Session
from tests.haptics.servo.test_servo_process import publishing, until
from tests.haptics.spring import SpringChain

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="kills and stops processes as Linux does")


@pytest.fixture
def session(request, tmp_path, monkeypatch):
    """Makes a session at a driver."""
    with DRIVERS[getattr(request, "param", "ros1")](tmp_path, monkeypatch) as heard:
        made: list[Session] = []

        def make(often: str = "always") -> Session:
            made.append(Session(heard, often))
            return made[-1]

        yield make
        for one in made:
            one.close()


everywhere = pytest.mark.parametrize("session", DRIVERS, indirect=True)


@everywhere
@pytest.mark.parametrize("victims", [("servo",), ("servo", "parent"), ("parent", "servo")], ids="-".join)
def test_a_killed_servo_leaves_no_force_at_its_driver(session, victims):
    run = session()
    since = [run.signal(who) for who in victims][victims.index("servo")]
    print(f"zero force after {1e3 * run.heard.falls(since):.0f} ms")
    run.parent.poll()
    assert run.lives("parent") == ("parent" not in victims)
    until(lambda: not run.lives("guardian"))  # it has done its work


def test_a_killed_parent_leaves_no_force_and_no_process(session):
    run = session()
    run.heard.falls(run.signal("parent"))
    until(lambda: not run.lives("servo") and not run.lives("guardian"))


def test_a_killed_guardian_disarms_and_another_takes_its_place(session):
    """Whether the servo first misses the one or first hears the other. Then the servo is killed as well, and the new
    guardian does what the first would have done."""
    run = session("once")
    since = run.signal("guardian")
    run.heard.falls(since)
    until(lambda: run.status is not None and "its guardian" in run.status.hands[0].message, run.look)
    assert run.lives("servo")
    until(run.heard.pushes, lambda: (run.arm(), time.sleep(0.05)))  # once the new guardian is ready
    run.heard.falls(run.signal("servo"))


@everywhere
def test_a_stopped_servo_is_zeroed_meanwhile_and_goes_on_disarmed(session):
    run = session("once")
    run.heard.falls(run.signal("servo", signal.SIGSTOP))
    run.look()
    while run.hand.force == ZERO:  # its parent had been kept waiting for more than 20 ms just before
        print(run.hand.state, run.status.hands[0].message)
        run.signal("servo", signal.SIGCONT)
        until(run.heard.pushes, lambda: (run.arm(), time.sleep(0.05)))
        run.heard.falls(run.signal("servo", signal.SIGSTOP))
        run.look()
    before = run.hand  # so the servo itself said last
    time.sleep(2.0)
    run.signal("servo", signal.SIGCONT)
    until(lambda: run.hand.tick > before.tick + 100, run.look)
    assert (run.hand.state, run.hand.force) == ("disarmed", ZERO)
    assert "disarmed: the servo stood still for" in run.status.hands[0].message
    assert not run.heard.pushes()
    run.arm()
    until(run.heard.pushes)


def test_a_stopped_guardian_disarms_and_may_go_on(session):
    run = session("once")
    run.heard.falls(run.signal("guardian", signal.SIGSTOP))
    until(lambda: run.status is not None and "no word of its guardian" in run.status.hands[0].message, run.look)
    run.signal("guardian", signal.SIGCONT)
    until(run.heard.pushes, lambda: (run.arm(), time.sleep(0.05)))
    run.heard.falls(run.signal("servo"))


def test_a_stopped_parent_leaves_no_force_and_finds_its_hand_disarmed(session):
    run = session("once")
    run.heard.falls(run.signal("parent", signal.SIGSTOP))
    until(lambda: run.hand is not None and run.hand.state == "disarmed", run.look)
    run.signal("parent", signal.SIGCONT)
    before = run.hand.tick
    until(lambda: run.hand.tick > before + 300, run.look)
    assert (run.hand.state, run.hand.force) == ("disarmed", ZERO)
    assert not run.heard.pushes()


def test_a_guardian_that_is_kept_waiting_counts_all_of_the_time():
    """Two looks show that a servo stands still, however late they come; one that went on has left a newer cycle."""
    frames = Mailbox.create(HandLayout(1))
    try:
        side = GuardedSide(Mailbox.attach(HandLayout(1), frames.name), Mailbox.attach(HandLayout(1), frames.name), None)
        for now in (10.0, 12.0):
            frames.write(ServoFrame(1, 0.0, ZERO, ZERO, (), "armed", 0.0))
            assert side.look(now) == 0.0
        assert [side.look(now) for now in (12.03, 12.06)] == pytest.approx([0.03, 0.06])
    finally:
        frames.close()


def test_the_end_of_a_process_wakes_who_waits_for_it():
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        ended = process_ended(process.pid)
        assert ended is not None and not ended(0.0)
        killer = threading.Thread(target=process.kill)
        killer.start()
        assert ended(60.0)
        killer.join()


def test_a_servo_that_is_killed_with_its_device_in_it_says_so():
    """The virtual device vanishes with its servo; the page must not show the force that was there."""
    with ServoProcess([HandSetup("virtual:hold,at=0.01/0/0", SpringChain)], spheres=1, traps=1) as servo:
        assert servo.guardian is None and servo.residue(0) is None
        publish = publishing(servo)
        until(lambda: servo.hand(0) is not None and servo.hand(0).force[0] < 0.0, publish)
        os.kill(servo.pid, signal.SIGKILL)
        until(lambda: not servo.alive)
        found = servo.residue(0)
        assert found.zero
        assert found.message == "the servo was killed (SIGKILL), nothing is felt; start the session anew"


def test_every_kind_says_what_keeps_its_last_force():
    kept = {kind: row.keeps for kind, row in KINDS.items() if row.keeps != "nothing"}
    drivers = dict.fromkeys(("ros1", "inverse3", "dualsense"), "driver")
    assert kept == drivers | dict.fromkeys(("openhaptics", "forcedimension"), "library")
