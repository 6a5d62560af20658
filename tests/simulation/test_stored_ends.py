"""Checkpoints of worlds that end: trials, clocks and what has ended go on bit for bit; other functions are refused."""

from __future__ import annotations

import numpy as np
import pytest

import otwarp as ot
from otwarp.errors import InputError
from otwarp.simulation.simulation import Simulation
from tests.simulation.test_checkpoint import authored, rewrite
from tests.simulation.test_episodes import WORLDS, above, assert_same_worlds, finish, lossy_scene, simulate


def continued(sim: Simulation) -> None:
    """What the tests do from the middle on: step, end, reset, step."""
    for _ in range(3):
        sim.step(100)
        sim.reset(sim.episodes.done)


@pytest.fixture
def scene(tmp_path):
    return authored(lossy_scene(), tmp_path / "bead.usda")


ENDS = (ot.escaped, ot.timed_out(after=[1.0, 2.0] * (WORLDS // 2)), above(height=5.0))


@pytest.mark.parametrize("part", [None, (2, 6)])
def test_goes_on_bit_for_bit(part, scene, tmp_path, device):
    """In the middle of trials, some of them ended and not reset, and with parameters of all worlds in a part."""
    viscosity = np.linspace(8e-4, 1e-3, WORLDS)
    options = {"parameters": {"medium_viscosity": viscosity}, "part": part}
    whole, first = (simulate(scene, device, ends=ENDS, **options) for _ in range(2))
    for sim in (whole, first):
        sim.step(150)
        sim.reset([1])
        finish(sim, [0, 3])
        sim.step(20)
    again = Simulation.restore(first.save(tmp_path / "half.npz"), device=device, ends=[above])
    assert again.state.step == 170 and again.model.first_world == (part or (0,))[0]
    for sim in (whole, again):
        continued(sim)
    assert_same_worlds(again, slice(None), whole, slice(None))
    for name in ("done", "step", "number"):
        assert np.array_equal(getattr(again.episodes, name).numpy(), getattr(whole.episodes, name).numpy()), name
    assert whole.episodes.number.numpy().max() >= WORLDS


def test_a_part_without_ends(scene, tmp_path, device):
    whole, first = (simulate(scene, device, ends=None, part=(3, 5)) for _ in range(2))
    whole.step(200)
    first.step(80)
    again = Simulation.restore(first.save(tmp_path / "half.npz"), device=device)
    again.step(120)
    assert_same_worlds(again, slice(None), whole, slice(None))


@ot.end
def other(now: ot.WorldNow) -> bool:
    return now.step < 0  # type: ignore[operator]


def test_what_is_refused(scene, tmp_path, device):
    path = simulate(scene, device, ends=[above(height=5.0)]).save(tmp_path / "half.npz")
    plain = simulate(scene, device, ends=None).save(tmp_path / "plain.npz")
    for file, ends, says in (
        (path, None, r"was made with the end above; allowed: restore\(…, ends=\[…\]\)"),
        (path, [above, other], "was made with ends: above; given: above, other"),
        (plain, [above], "was made without ends; given: above"),
        (plain, [], "was made without ends; given: an empty list"),
    ):
        with pytest.raises(InputError, match=says):
            Simulation.restore(file, device=device, ends=ends)
    rewrite(path, about={"ends": [{"name": "above", "digest": "0" * 64}]})
    with pytest.raises(InputError, match="end above is another function than the one it was made with"):
        Simulation.restore(path, device=device, ends=[above])
