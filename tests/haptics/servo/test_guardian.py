"""What a driver is left with when processes are killed or stopped for real: zero force, whoever dies.

Drivers that go on without the servo stand here: a ROS 1 node, a Haply service, a pseudo-terminal for a controller.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.core.types import ZERO
from otwarp.haptics.devices import KINDS
from otwarp.haptics.servo.link import HandLayout, HandSetup, StatusLayout
from otwarp.haptics.servo.process import ServoProcess
from tests.haptics.hid_machine import ROOT as HID_ROOT
from tests.haptics.hid_machine import plug_dualsense
from tests.haptics.servo.test_servo_process import publishing, until
from tests.haptics.spring import SpringChain

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="kills and stops processes as Linux does")
ROOT = Path(__file__).resolve().parents[3]
NS = "/GeomagicLeft"
REST = 0.3
"""Seconds for which a driver must hear nothing but zero."""


class Heard:
    """Sizes of the forces that a driver was given, by time."""

    def __init__(self, device: str):
        self.device = device
        self.sizes: list[tuple[float, float]] = []

    def note(self, size: float) -> None:
        self.sizes.append((time.perf_counter(), size))

    def pushes(self) -> bool:
        return bool(self.sizes) and self.sizes[-1][1] > 0.0

    def falls(self, since: float) -> float:
        """Wait for zero force, see that it stays, and return how long after `since` it came [s]."""
        until(lambda: self.sizes[-1][1] == 0.0)
        time.sleep(REST)
        assert self.sizes[-1][1] == 0.0
        last = max(n for n, (_, size) in enumerate(self.sizes) if size > 0.0)
        return self.sizes[last + 1][0] - since


@contextmanager
def ros1_driver(uri: str, monkeypatch):
    """A node that publishes a pose as the release's driver does, and renders the last force for ever."""
    from otwarp.ros.ros1.messages import types
    from otwarp.ros.ros1.node import Ros1Node

    monkeypatch.setenv("ROS_MASTER_URI", uri)
    heard, t, over = Heard(f"ros1:{NS}"), types(), threading.Event()
    header, turn = t.Header(0, t.Time(0, 0), "world"), t.Quaternion(0.0, 0.0, 0.0, 1.0)
    still = t.PoseStamped(header, t.Pose(t.Point(0.0, 0.0, 0.0), turn))
    with Ros1Node("driver", poll=0.05) as driver:
        out = driver.publisher(f"{NS}/pose", "geometry_msgs/PoseStamped", latch=True)
        topic, kind = f"{NS}/force_feedback", "geomagic_control/DeviceFeedback"
        driver.subscribe(topic, kind, lambda m: heard.note(abs(m.force.x) + abs(m.force.y) + abs(m.force.z)))

        def _publish() -> None:
            while not over.wait(0.01):
                out.publish(still)

        thread = threading.Thread(target=_publish, daemon=True)
        thread.start()
        yield heard
        over.set()
        thread.join()


@contextmanager
def ros1_double(tmp_path, monkeypatch):
    pytest.importorskip("rosbags")
    from tests.ros.ros1.setups import MasterDouble

    master = MasterDouble()
    with ros1_driver(master.uri, monkeypatch) as heard:
        yield heard
    master.stop()


@contextmanager
def ros1_debian(tmp_path, monkeypatch):
    pytest.importorskip("rosbags")
    import shutil

    from tests.ros.ros1.conftest import RealMaster, _absent

    if shutil.which("rosmaster") is None:
        _absent("rosmaster")
    master = RealMaster(tmp_path)
    with ros1_driver(master.uri, monkeypatch) as heard:
        yield heard
    master.stop()


@contextmanager
def haply(tmp_path, monkeypatch):
    pytest.importorskip("websockets")
    from tests.haptics.haply_service import HaplyService

    with HaplyService() as service:
        heard = Heard(f"inverse3:{service.address}")
        take = service._take

        def _note(message) -> None:
            take(message)
            heard.note(sum(map(abs, service.forces["049D"][-1])) if service.forces["049D"] else 0.0)

        service._take = _note
        yield heard


@contextmanager
def dualsense(tmp_path, monkeypatch):
    from otwarp.haptics.devices.dualsense_report import OFF, encode_usb

    master, off = plug_dualsense(tmp_path), encode_usb(OFF)
    monkeypatch.setenv(HID_ROOT, str(tmp_path))
    heard = Heard("dualsense")

    def _read() -> None:
        waiting = b""
        while chunk := os.read(master, 4096):
            waiting += chunk
            while len(waiting) >= len(off):
                heard.note(float(waiting[: len(off)] != off))
                waiting = waiting[len(off) :]

    threading.Thread(target=_read, daemon=True).start()
    yield heard


DRIVERS = {"ros1": ros1_double, "ros1, Debian's master": ros1_debian, "inverse3": haply, "dualsense": dualsense}


class Session:
    """A parent, its servo and its guardian, under force at a driver."""

    def __init__(self, heard: Heard, often: str = "always"):
        self.heard = heard
        self.parent = subprocess.Popen(
            [sys.executable, "-m", "tests.haptics.parent", heard.device, often],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=ROOT,
        )
        said = json.loads(self.parent.stdout.readline())
        self.numbers = {"parent": self.parent.pid, "servo": said["servo"], "guardian": said["guardian"]}
        self.hands = Mailbox.attach(HandLayout(1), said["hands"][0])
        self.reports = Mailbox.attach(StatusLayout(1), said["status"])
        self.hand = self.status = None
        until(lambda: self.hand is not None and self.hand.state == "armed" and heard.pushes(), self._arm_first)
        time.sleep(REST)  # the parent has seen it as well

    def signal(self, who: str, what: int = signal.SIGKILL) -> float:
        os.kill(self.numbers[who], what)
        return time.perf_counter()

    def look(self) -> None:
        self.hand, self.status = self.hands.read() or self.hand, self.reports.read() or self.status

    def _arm_first(self) -> None:
        """A busy machine may let the watchdog disarm what its parent arms only once."""
        self.look()
        if self.hand is not None and self.hand.state == "disarmed":
            self.arm()

    def arm(self) -> None:
        self.parent.stdin.write(b"\n")
        self.parent.stdin.flush()

    def lives(self, who: str) -> bool:
        stat = Path(f"/proc/{self.numbers[who]}/stat")
        return stat.exists() and stat.read_text().rpartition(")")[2].split()[0] != "Z"

    def close(self) -> None:
        for who in ("parent", "servo"):
            if self.lives(who):
                os.kill(self.numbers[who], signal.SIGKILL)
                os.kill(self.numbers[who], signal.SIGCONT)
        self.parent.communicate()
        until(lambda: not self.lives("servo"))


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
    before = run.hand
    assert before.force != ZERO  # so the servo itself said last
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
