"""What tests of ROS 2 share."""

from __future__ import annotations

import pytest

from tests.ros.ros2.setups import loopback


@pytest.fixture
def domain(monkeypatch):
    """A domain of this test's own, on this machine alone."""
    return loopback(monkeypatch)
