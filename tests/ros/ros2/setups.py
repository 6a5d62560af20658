"""What the tests of ROS 2 share: a domain of their own on the loopback interface, and patience."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable

import pytest

PATIENCE = 60.0
"""How long two processes on a busy machine may take to find each other [s]: it ends a hung test, it asserts no
speed."""

VARIABLES = (
    "CYCLONEDDS_URI",
    "ROS_DOMAIN_ID",
    "ROS_LOCALHOST_ONLY",
    "ROS_AUTOMATIC_DISCOVERY_RANGE",
    "ROS_STATIC_PEERS",
)


def loopback(monkeypatch: pytest.MonkeyPatch) -> int:
    """Keep to the loopback interface, found by unicast (containers may have no multicast), in a domain of its own.

    Returns:
        The domain, 100 to 200: another for each process, since neighbours in a parallel run differ in their numbers.
    """
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    return 100 + os.getpid() % 101


def expect_soon(condition: Callable[[], object], what: str) -> None:
    """Wait for something that another thread or process does."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"waited in vain for: {what}"
        time.sleep(0.005)


def child(code: str, *arguments: object) -> subprocess.Popen[str]:
    """A Python process that talks by lines."""
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", code, *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=dict(os.environ),
    )
