"""Masters: a double in this process, and Debian's."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from otwarp.ros.ros1.node import Ros1Node, check_master

from .setups import POLL, MasterDouble, expect_soon

SYSTEM_PYTHON = "/usr/bin/python3"
REQUIRED = "OTWARP_REQUIRE_ROS1"
"""Set to 1 where Debian's ROS must be there: its absence then fails instead of skipping."""
PACKAGES = "python3-rosmaster python3-rospy python3-geometry-msgs python3-sensor-msgs python3-tf2-msgs"


@pytest.fixture(autouse=True)
def _no_ros_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the user's shell says of ROS is not for the tests."""
    for name in ("ROS_MASTER_URI", "ROS_HOSTNAME", "ROS_IP", "ROS_NAMESPACE"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def master() -> Iterator[MasterDouble]:
    double = MasterDouble()
    yield double
    double.stop()


def _absent(what: str) -> None:
    reason = f"{what} is not here: apt-get install --no-install-recommends {PACKAGES}"
    if os.environ.get(REQUIRED) == "1":
        pytest.fail(f"{REQUIRED}=1, and {reason}")
    pytest.skip(reason)


def clean_environment(**more: str) -> dict[str, str]:
    """For processes of the system's Python: nothing of this one's."""
    return {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "ROS_", "VIRTUAL_ENV"))} | more


class RealMaster:
    """A process of Debian's `rosmaster` on a free port."""

    def __init__(self, logs: Path) -> None:
        with socket.create_server(("127.0.0.1", 0)) as probe:
            self.port: int = probe.getsockname()[1]
        self.uri = f"http://127.0.0.1:{self.port}/"
        self.environment = clean_environment(
            ROS_MASTER_URI=self.uri, ROS_IP="127.0.0.1", ROS_LOG_DIR=str(logs), ROS_HOME=str(logs)
        )
        self.start()

    def start(self) -> None:
        command = [str(shutil.which("rosmaster")), "--core", "-p", str(self.port)]
        self._process = subprocess.Popen(
            command, env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        expect_soon(self._answers, "rosmaster")

    def _answers(self) -> bool:
        assert self._process.poll() is None, "rosmaster ended"
        try:
            check_master(self.uri)
        except ValueError:
            return False
        return True

    def stop(self) -> None:
        self._process.terminate()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


@pytest.fixture(scope="session")
def real_master(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealMaster]:
    if shutil.which("rosmaster") is None:
        _absent("rosmaster")
    running = RealMaster(tmp_path_factory.mktemp("ros"))
    yield running
    running.stop()


@pytest.fixture(scope="session")
def rospy_python() -> str:
    """A Python that has Debian's rospy and the messages of the contract."""
    needed = "import rospy, geometry_msgs.msg, sensor_msgs.msg, tf2_msgs.msg"
    if not Path(SYSTEM_PYTHON).exists():
        _absent(SYSTEM_PYTHON)
    done = subprocess.run([SYSTEM_PYTHON, "-c", needed], env=clean_environment(), capture_output=True, check=False)
    if done.returncode != 0:
        _absent("rospy")
    return SYSTEM_PYTHON


@pytest.fixture
def node(master):
    """Makes nodes on the double, closed at the end."""
    made = []

    def make(name: str) -> Ros1Node:
        made.append(Ros1Node(name, master.uri, poll=POLL))
        return made[-1]

    yield make
    for one in made:
        one.close()
