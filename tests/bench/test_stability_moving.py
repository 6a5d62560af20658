"""Stress tests of rotors and of commands with fine samples: accurate at steps at which each was silently wrong."""

from __future__ import annotations

import pytest

from otwarp.bench.stability.moving import blinking, circling, rotor
from otwarp.bench.stability.thermal import Effort
from otwarp.bench.stability.verdict import CellVerdict


@pytest.fixture
def effort(device) -> Effort:
    return Effort(device=device, worlds=4096)


def test_a_trap_that_circles_once_a_step(effort):
    """The bead was 0.1 of the radius off in every step."""
    assert circling(effort, turns=1.0, product=0.1).verdict is CellVerdict.ACCURATE


def test_a_trap_that_blinks_once_a_step(effort):
    """It was on always."""
    assert blinking(effort, share=0.3, product=0.05).verdict is CellVerdict.ACCURATE


@pytest.mark.parametrize("along", [False, True], ids=["orientation", "axis"])
def test_a_free_dimer_at_twice_the_chosen_step(along, effort):
    """D_r dt = 0.48: the displacement along the axis was 5 % too large; standard error 0.8 %."""
    found = rotor(effort, length=2, factor=2.0, along=along)
    assert found.verdict is CellVerdict.ACCURATE
    assert 0.0 < abs(found.predicted) < 0.02
