"""Worlds that go on from states elsewhere, against the same worlds without the interruption."""

from __future__ import annotations

import numpy as np
import pytest

import otwarp as ot
from otwarp.scene import Scene
from otwarp.simulation.options import StepOptions
from otwarp.studies.rare.ensemble import Ensemble
from otwarp.studies.rare.states import PARTS, States, read, write
from tests.studies.scenes import bead_in_a_well, pair_in_wells

SCENES = {"bead": bead_in_a_well, "dragged robot": lambda folder: pair_in_wells(folder, speed=5.0)}
WORLDS, LOOKS = 8, 20
NUMBERS = np.arange(100, 100 + WORLDS, dtype=np.uint32)


def ensemble(scene: Scene, worlds: int) -> Ensemble:
    """As many worlds, in steps of 0.5 ms."""
    options = StepOptions(integrator="heun")
    return Ensemble(
        scene, {}, worlds, order=ot.distance(), seed=3, time_step=5e-4, every=2, options=options, device="cpu"
    )


def gone_on(of: Ensemble, worlds: np.ndarray) -> States:
    """States of worlds after more looks."""
    of.between(worlds, -np.inf, np.inf)
    for _ in range(LOOKS):
        of.look()
    return of.states(worlds)


def same(a: States, b: States) -> bool:
    bits = all(a.parts[name].tobytes() == b.parts[name].tobytes() for name in PARTS)
    return bits and np.array_equal(a.clock, b.clock) and np.array_equal(a.order, b.order)


@pytest.mark.parametrize("make", SCENES.values(), ids=SCENES)
def test_states_are_all_that_a_world_goes_on_from(tmp_path, make):
    """Read from one simulation, kept in a file, written into worlds of another one that is larger and has gone its own
    way: with the noise of the same trials the bits of those that were not interrupted, else others."""
    scene, everyone = Scene.load(make(tmp_path)), np.arange(WORLDS)
    first = ensemble(scene, WORLDS)
    first.start(everyone, NUMBERS)
    half = gone_on(first, everyone)
    np.savez(tmp_path / "half.npz", clock=half.clock, order=half.order, escaped=half.escaped, **half.parts)
    whole = gone_on(first, everyone)
    assert np.all(half.clock == 2 * LOOKS) and np.all(whole.clock == 4 * LOOKS) and not np.any(whole.escaped)

    with np.load(tmp_path / "half.npz") as file:
        kept = States({name: file[name] for name in PARTS}, file["clock"], file["order"], file["escaped"])
    other, all_others = ensemble(scene, 3 * WORLDS), np.arange(3 * WORLDS)
    other.start(all_others, all_others)
    gone_on(other, all_others)
    places = 2 * WORLDS - 3 * everyone % WORLDS
    write(other.sim, places, kept, NUMBERS)
    assert same(read(other.sim, places, kept.order, kept.escaped), kept)
    assert same(gone_on(other, places), whole)
    write(other.sim, places, kept, NUMBERS + WORLDS)
    place = "state.position"
    assert not np.any(np.all(gone_on(other, places).parts[place] == whole.parts[place], axis=(1, 2)))
