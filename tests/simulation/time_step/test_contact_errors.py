"""What is told of gaps in contact: which scenes have them, how large the error is, and that it is not larger."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from otwarp.bench.stability.gaps import beads_in_box
from otwarp.scene import Medium, Scene, Settings
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.time_step.contact_errors import MOST, ONE, SEVERAL
from tests.simulation.setups import STIFFNESS, drag, harmonic, line, obstacle, robot, sphere_body

RELAXATION = drag(1.0) / STIFFNESS


def scales(scene: Scene, z: float = 0.1):
    return Model.build(scene, device="cpu", options=StepOptions(time_step=z * RELAXATION)).scales


def beads(*places, floor: float | None = None, free: int = 0, cutoff: float = 0.9) -> Scene:
    """Beads of 1 µm in springs of 20 pN/µm, but for the last `free` of them."""
    held = places[: len(places) - free]
    return Scene(
        bodies=tuple(sphere_body(f"B{i}", p, collides=True) for i, p in enumerate(places)),
        traps=tuple(harmonic(f"T{i}", p, cutoff=cutoff, holds=f"/World/B{i}/S") for i, p in enumerate(held)),
        obstacles=() if floor is None else (obstacle("floor", "plane", (0.0, 0.0, floor)),),
        settings=Settings(gravity=False),
    )


HOME, NEAR, FAR = (0.0, 0.0, 0.0), (2.3, 0.0, 0.0), (4.0, 0.0, 0.0)

ROBOT = robot("R", HOME, shape=(((-1.1, 0.0, 0.0), 1.0), ((1.1, 0.0, 0.0), 1.0)), collides=True)


@pytest.mark.parametrize(
    ("scene", "told"),
    [
        (beads(HOME, FAR, floor=-3.0), None),
        (beads(HOME, NEAR, floor=-3.0), ONE),
        (beads(HOME, FAR, floor=-1.2), ONE),
        (beads(HOME, NEAR, floor=-1.2), MOST),
        (beads(HOME, NEAR, (-2.3, 0.0, 0.0)), MOST),
        # what no trap holds may come to anything
        (beads(HOME, FAR, free=1), ONE),
        (beads(HOME, FAR, floor=-3.0, free=1), MOST),
        # a trap that is lost at 30 k_B T
        (beads(HOME, FAR, floor=-3.0, cutoff=0.15), MOST),
        (Scene(bodies=(ROBOT,), traps=(harmonic("T", HOME, cutoff=9.0),)), None),
    ],
    ids=["apart", "pair", "floor", "both", "row", "one free", "free over floor", "shallow", "alone"],
)
def test_told_is_what_bodies_can_come_to(scene, told):
    assert scales(scene).errors.get("contact") == (None if told is None else pytest.approx(told))


def test_a_moving_trap_carries_its_bead_to_others():
    """30 k_B T carry a bead 0.22 µm along the beam."""
    still = beads(HOME, FAR)
    carried = dataclasses.replace(still.traps[0], position=line((0.0, HOME), (1.0, (1.7, 0.0, 0.0))))
    moved = dataclasses.replace(still, traps=(carried, still.traps[1]))
    assert "contact" not in scales(still).errors
    assert scales(moved).errors["contact"] == pytest.approx(ONE)


def test_it_falls_with_the_fourth_root_of_the_step_and_shortens_none():
    """Eight beads in a box and a spring of 0.02 pN/µm: at the chosen step 9 %, where gaps to walls err by 4 ± 1 %."""
    box = Model.build(beads_in_box(0.02), device="cpu").scales
    z = box.time_step / box.trap_relaxation
    assert z < 0.02 and box.chosen_by != "gaps in contact"
    assert box.errors["contact"] == pytest.approx(SEVERAL * math.sqrt(2.0 * math.sqrt(30.0 * z)))
    finer = Model.build(beads_in_box(0.02, time_step=box.time_step / 16.0), device="cpu").scales
    assert finer.errors["contact"] == pytest.approx(0.5 * box.errors["contact"], rel=1e-6)
    # nor is an explicit step refused for them that springs allow
    errors = scales(beads(HOME, NEAR, (-2.3, 0.0, 0.0)), 0.19).errors
    assert errors["contact"] > 0.1 > abs(errors["variance"])


def test_weight_presses_as_a_trap_does():
    free = Scene(bodies=beads(HOME, NEAR).bodies, obstacles=beads(HOME, floor=-1.2).obstacles)
    assert "contact" not in scales(free).errors
    light, heavy = (
        Scene(
            bodies=tuple(sphere_body(f"B{i}", p, collides=True, density=rho) for i, p in enumerate((HOME, NEAR))),
            obstacles=free.obstacles,
            settings=Settings(gravity=True),
        )
        for rho in (1.01 * Medium().density, 1.1 * Medium().density)
    )
    small, large = (scales(scene).errors["contact"] for scene in (light, heavy))
    assert 0.0 < small < large < MOST


def gaps_of_two(pull: tuple[float, float], spread: float, count: int, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors of both mean gaps and of how many are below the spread, and their standard errors, in one dimension.

    A wall at 0, a bead at a ≥ 0 and another at b ≥ a with forces [k_BT], mobility and k_BT 1, and the law of
    `excursion`; both contacts are solved together. By Boltzmann a and b − a are exponentially distributed.
    """
    rng = np.random.default_rng(3)
    rates = np.array([-(pull[0] + pull[1]), -pull[1]])
    gap = rng.exponential(1.0 / rates, (count, 2))
    seen = []
    for step in range(steps):
        free = np.array(pull) * 0.5 * spread**2 + spread * rng.standard_normal((count, 2))
        wander = -2.0 * spread**2 * np.log(rng.random((count, 2))) * [1.0, 2.0]
        first, second = np.zeros(count), np.zeros(count)
        for _ in range(40):
            opening = free[:, 0] - 0.5 * second
            first = np.maximum(0.5 * (np.sqrt(opening**2 + wander[:, 0]) - opening) - gap[:, 0], 0.0)
            opening = free[:, 1] - free[:, 0] - first
            second = np.maximum(0.5 * (np.sqrt(opening**2 + wander[:, 1]) - opening) - gap[:, 1], 0.0)
        gap[:, 0] += free[:, 0] + first - 0.5 * second
        gap[:, 1] += free[:, 1] - free[:, 0] - first + second
        if step > steps // 3:
            seen.append(np.concatenate([gap * rates, (gap < spread) / (1.0 - np.exp(-spread * rates))], axis=1))
    means = np.mean(seen, axis=0)
    return means.mean(axis=0) - 1.0, means.std(axis=0) / math.sqrt(count)


@pytest.mark.thorough
@pytest.mark.parametrize("pull", [(0.0, -1.0), (0.5, -1.0), (0.75, -1.0), (-1.0, -1.0)])
@pytest.mark.parametrize("pressed", [0.5, 1.0, 4.0])
def test_two_contacts_of_one_bead_err_by_less_than_is_told(pull, pressed):
    """φ from 0.5 to 4; the standard errors are below 0.015."""
    error, chance = gaps_of_two(pull, pressed, 20_000, 60)
    assert chance.max() < 0.015
    assert np.all(np.abs(error) < min(MOST, SEVERAL * math.sqrt(pressed)) + 5.0 * chance)
    # and it is there
    assert np.abs(error).max() > 0.02
