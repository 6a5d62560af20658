"""Who sends forces to a driver, and which driver went away: over the wire, with a master that knows the dead, too."""

from __future__ import annotations

import socket

import pytest

from otwarp.errors import InputError
from otwarp.haptics.core import DeviceLost
from otwarp.haptics.devices.ros1 import SILENCE, Ros1Device, zero_force
from otwarp.ros.ros1.node import Ros1Node

from .setups import expect_soon
from .test_device import NS, pose

FORCES, KIND = f"{NS}/force_feedback", "geomagic_control/DeviceFeedback"


@pytest.fixture
def driver(master, monkeypatch):
    """A node that publishes a pose as the driver does."""
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    with Ros1Node("omni_left", poll=0.05) as node:
        node.publisher(f"{NS}/pose", "geometry_msgs/PoseStamped", latch=True).publish(pose(0.0, 0.0, 0.0))
        yield node


def opened() -> Ros1Device:
    device = Ros1Device(NS)
    device.open()
    return device


def test_a_namespace_that_another_node_sends_forces_to_is_refused(driver):
    with Ros1Node("force_pub", poll=0.05) as other:
        other.publisher(FORCES, KIND)
        with pytest.raises(InputError, match=f"/force_pub publishes {FORCES} already; a device has one owner") as error:
            opened()
        assert "\n" not in str(error.value)
    opened().close()


def test_a_node_that_was_killed_does_not_own_it(driver, master):
    """A master keeps it in its books; so does ours, until nobody answers there."""
    with socket.create_server(("127.0.0.1", 0)) as gone:
        port = gone.getsockname()[1]
    master.publishers.setdefault(FORCES, {})["/killed"] = (f"http://127.0.0.1:{port}/", KIND)
    opened().close()
    with socket.create_server(("127.0.0.1", 0)) as stopped:  # takes connections and answers none, as a stopped node
        master.publishers[FORCES]["/killed"] = (f"http://127.0.0.1:{stopped.getsockname()[1]}/", KIND)
        with pytest.raises(InputError, match="/killed publishes"):
            opened()


def test_a_guardian_is_no_owner_and_sends_zero_to_the_driver(driver):
    heard = []
    driver.subscribe(FORCES, KIND, heard.append)
    guardian = zero_force(NS)
    device = opened()
    expect_soon(lambda: (device.write((0.0, 0.5, 0.0)), heard)[1], "a force")
    expect_soon(lambda: (guardian.send(), heard[-1].force.y == 0.0)[1], "zero force beside it")
    device.close()
    guardian.close()


def test_a_driver_that_goes_away_is_named(driver):
    device = opened()
    device.read(0.0)
    with pytest.raises(DeviceLost, match=r"driver /omni_left is connected and silent: no pose for 0\.5 s"):
        device.read(SILENCE + 0.1)
    driver.close()
    expect_soon(lambda: device._pose.connections == 0)
    with pytest.raises(DeviceLost, match=r"driver /omni_left has gone: no pose for 0\.5 s"):
        device.read(SILENCE + 0.2)
    lines = device._node.log.lines
    expect_soon(lambda: any("/omni_left (http" in line and "has gone" in line for line in lines), "its name in the log")
    device.close()
