"""Kinds whose binding never met a device say so, and a session with one says it first."""

from __future__ import annotations

import pytest

from otwarp.cli.main import main
from otwarp.haptics.devices import KINDS

SOFTWARE = ("mouse", "virtual", "replay")


@pytest.mark.parametrize("name", KINDS)
def test_hardware_that_was_never_met_is_cautioned_of(name):
    assert KINDS[name].met_hardware == (name in SOFTWARE)
    assert bool(KINDS[name].caution) == (name not in SOFTWARE)


def test_a_session_says_it_first(capfd):
    """A driver in ROS 1 that is not there: the caution comes before the line that says so."""
    words = ["--left", "ros1:/Nobody", "--no-page", "--duration", "0.1"]
    assert main(["teleop", "scenes/teleop_small.usda", *words]) == 2
    out, error = capfd.readouterr()
    assert out == "left      ros1:/Nobody: this way was tested on doubles; no such device has met it\n"
    assert error.count("\n") == 1
