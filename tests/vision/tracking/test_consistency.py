"""NEES and NIS of the filter on what `Simulation` does: within five standard errors of 1, and beyond where it is wrong.

The standard error of a mean of n squares per degree of freedom is √(2 / (n d)), of n that amount to as many as are
uncorrelated (`consistency`).
"""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.scene import Scene
from tests.vision.tracking.truth import Looks, followed

SIGMAS = 5.0

BIAS = 0.02
"""Of variances: the time step of the simulation keeps them to 1 %, expansion within 0.1 µm to as much."""


def right(looks: Looks) -> bool:
    return all(abs(c.mean - 1.0) < BIAS + SIGMAS * c.error for c in (looks.nees, looks.nis))


@pytest.mark.quick
def test_a_bead_is_followed_consistently() -> None:
    scene = Scene.load("scenes/single_bead.usda")
    looks = followed(scene, worlds=4, frames=60, interval=0.01, seed=1)
    assert right(looks)
    assert np.sqrt(np.mean(looks.filtered**2)) < 0.85 * np.sqrt(np.mean(looks.raw**2))


@pytest.mark.quick
def test_noise_that_is_stated_wrongly_is_noticed() -> None:
    scene = Scene.load("scenes/single_bead.usda")
    assert not right(followed(scene, worlds=4, frames=60, interval=0.01, seed=1, noise=1.4))


@pytest.mark.validate
def test_a_trap_that_jumps() -> None:
    scene = Scene.load("scenes/single_bead.usda")
    home = np.array(scene.bodies[0].position)
    jumps = lambda t: home[None] + [0.3 * np.sign(np.sin(2.0 * np.pi * t / 0.2) + 1e-3), 0.0, 0.0]  # noqa: E731
    looks = followed(scene, worlds=6, frames=150, interval=0.01, seed=2, commanded=jumps)
    assert right(looks)


@pytest.mark.validate
@pytest.mark.parametrize("drop", [0.0, 0.3])
def test_a_dimer(drop: float) -> None:
    looks = followed(Scene.load("scenes/two_trap_dimer.usda"), worlds=6, frames=150, interval=0.01, seed=3, drop=drop)
    assert right(looks)
    # all but the first measurement of a track passed the gate
    assert all(tracker.hypotheses for tracker in looks.trackers)


@pytest.mark.validate
def test_a_body_that_lies_down_as_its_traps_part() -> None:
    looks = followed(Scene.load("scenes/strategy_a.usda"), worlds=6, frames=280, interval=0.02, seed=1)
    assert right(looks)
    for direction in range(3):
        assert np.std(looks.filtered[:, direction]) < 0.6 * np.std(looks.raw[:, direction])


@pytest.mark.validate
@pytest.mark.parametrize("noise", [0.7, 1.3])
def test_wrong_noise_of_a_dimer_is_noticed(noise: float) -> None:
    scene = Scene.load("scenes/two_trap_dimer.usda")
    assert not right(followed(scene, worlds=6, frames=150, interval=0.01, seed=3, noise=noise))


@pytest.mark.validate
def test_mobility_that_is_wrong_is_noticed() -> None:
    """A bead in water of half the viscosity, which the tracker does not know of."""
    import dataclasses

    from otwarp.vision.tracking import mobile

    scene = Scene.load("scenes/single_bead.usda")
    thick = dataclasses.replace(scene.medium, viscosity=0.4 * scene.medium.viscosity)
    keep = mobile.MobileBody.expansion
    factor = thick.viscosity / scene.medium.viscosity

    def slower(self: mobile.MobileBody, *given: np.ndarray) -> object:
        found = keep(self, *given)
        return dataclasses.replace(found, diffusion=factor * found.diffusion)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mobile.MobileBody, "expansion", slower)
        assert not right(followed(scene, worlds=6, frames=100, interval=0.01, seed=4))
