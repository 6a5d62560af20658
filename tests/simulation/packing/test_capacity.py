"""How many worlds fit: told before any memory is taken."""

from __future__ import annotations

import pytest

from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.simulation.frame import SHAPES
from otwarp.simulation.packing.capacity import BODY_NUMBERS, TRAP_NUMBERS, check_worlds, most_worlds, world_bytes
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import bead_scene


def test_a_world_takes_at_least_what_a_frame_of_it_does():
    numbers = {"body": 0, "trap": 0}
    for axis, width in SHAPES.values():
        numbers[axis] += max(width, 1)
    assert numbers == {"body": BODY_NUMBERS, "trap": TRAP_NUMBERS}


def test_worlds_that_do_not_fit_are_refused_before_anything_is_allocated(device):
    scene, place = bead_scene(), pick_device(device)
    assert world_bytes(scene) == 4 * (BODY_NUMBERS + TRAP_NUMBERS) and world_bytes(scene, "float64") == 2 * world_bytes(
        scene
    )
    most = most_worlds(scene, place)
    assert most_worlds(scene, place, "float64") in (most, most // 2) and most_worlds(scene, place, copies=3) < most
    check_worlds(scene, most, place)
    for worlds in (most + 1, 2**40, 10**30):
        with pytest.raises(InputError, match=rf"worlds is {worlds}; allowed: 1 … {most}, ") as caught:
            Simulation(scene, worlds=worlds, device=device)
        assert "\n" not in str(caught.value)
