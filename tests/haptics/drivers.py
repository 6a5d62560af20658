"""Drivers that go on without the servo, and a session at one of them whose processes may be killed or stopped.

A ROS 1 node, a Haply service and a pseudo-terminal for a controller stand for the drivers; `benchmarks.guardian` times
them.
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
from otwarp.haptics.servo.link import HandLayout, StatusLayout
from tests.haptics.hid_machine import ROOT as HID_ROOT
from tests.haptics.hid_machine import plug_dualsense
from tests.haptics.servo.test_servo_process import until

ROOT = Path(__file__).resolve().parents[2]
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

    def at(self, time: float) -> float:
        """Size of the force at a time."""
        return next((size for when, size in reversed(self.sizes) if when <= time), 0.0)

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
    from otwarp.haptics.devices.dualsense import OFF, encode_usb

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
        """A parent that is kept waiting for 100 ms lets the watchdog disarm what it arms only once."""
        self.look()
        if self.hand is not None and self.hand.state == "disarmed":
            self.arm()

    def arm(self) -> None:
        self.parent.stdin.write(b"\n")
        self.parent.stdin.flush()

    def lives(self, who: str) -> bool:
        stat = Path(f"/proc/{self.numbers[who]}/stat")
        try:  # it may end between two looks
            return stat.read_text().rpartition(")")[2].split()[0] != "Z"
        except (FileNotFoundError, ProcessLookupError):
            return False

    def close(self) -> None:
        for who in ("parent", "servo"):
            if self.lives(who):
                os.kill(self.numbers[who], signal.SIGKILL)
                os.kill(self.numbers[who], signal.SIGCONT)
        self.parent.communicate()
        until(lambda: not self.lives("servo"))
