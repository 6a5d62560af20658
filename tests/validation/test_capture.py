"""Whether a bead that starts beside a tabulated trap is still held, by power, start and time, as studies count it.

A tabulated force has no potential, so the law is the backward Fokker–Planck equation ∂P/∂t = L†P in the ball in which
the engine holds a sphere, P = 0 at its surface (Gardiner 2009, Stochastic Methods, §5.5), by finite volumes on two
grids, with the exact force of the same beam.
"""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest

import otwarp as ot
from otwarp.bench.integrators.fokker_planck import Force, survival_probability
from otwarp.bench.integrators.wells import SplinedForce, Well
from otwarp.bench.rungs import TrappedBead
from otwarp.optics import Beam, Particle
from otwarp.studies.observables import trapped
from otwarp.studies.stopping.rules import trials
from otwarp.studies.study import Study
from otwarp.units import BOLTZMANN

SCENE = Path(__file__).parents[2] / "scenes" / "table_trap.usda"
BEAM, SPHERE = Beam(numerical_aperture=1.2, polarization="circular"), Particle(radius=0.5, index=1.59)
ENERGY, DRAG = BOLTZMANN * 298.15, 6.0 * np.pi * 0.00089 * 0.5
POWERS, STARTS, TIMES = (0.02, 0.06), (0.0, 1.4, 2.0, 2.4), (0.1, 0.3, 1.0)
"""[mW], distances from the equilibrium across the beam [µm], and when [s]."""

STEP = 0.01
"""What the step may change of the share that is lost."""


def capture(count: int, device: str) -> tuple[Study, np.ndarray]:
    """The study, and (powers, starts, times) shares of beads that are held."""
    centre = ot.Scene.load(SCENE).traps[0].position.at(0.0) + TrappedBead(BEAM, SPHERE).centre
    study = Study(
        SCENE,
        axes={
            "trap_power": ot.values(POWERS, unit="mW"),
            "start:/World/bead": ot.values(centre + np.outer(STARTS, [1.0, 0.0, 0.0]), unit="µm"),
        },
        observables=[trapped(until=t).called(f"held_{n}") for n, t in enumerate(TIMES)],
        stop=trials(count),
        seed=21,
        time_step=1e-3,
    )
    found = study.compute([*range(len(study.blocks()))], device=device)
    end = np.concatenate([part["end"].reshape(-1, count) for part in found]).reshape(2, 4, count)
    time = np.concatenate([part["end_time"].reshape(-1, count) for part in found]).reshape(2, 4, count)
    assert np.all(end >= 0)
    lost = [np.mean((end == 1) & (time <= t), axis=-1) for t in TIMES]
    return study, 1.0 - np.stack(lost, axis=-1)


@functools.cache
def force_at_1_mw(reach: float) -> Force:
    """Exact force from the equilibrium, up to that distance [µm], at 1 mW, to which it is proportional [pN]."""
    well = Well(TrappedBead(BEAM.with_power(1.0), SPHERE))
    return well.about_centre(SplinedForce(well.bead.beam, SPHERE, reach + 0.5, "cpu"))


def law(study: Study, power: float, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities to be held that long from each start, and how wrong they may be."""
    reach = float(ot.Simulation(study.design.scene, device="cpu").model.held_range[0, 0])
    at_1_mw = force_at_1_mw(reach)
    found = survival_probability(
        lambda r: power * at_1_mw(r), reach, np.maximum(STARTS, 1e-3), time,
        diffusion=ENERGY / DRAG, energy=ENERGY, shells=64, sectors=40,
    )  # fmt: skip
    return np.array([e.value for e in found]), np.array([e.error for e in found])


def check(expect_law, device: str, count: int, times: tuple[float, ...]) -> None:
    study, held = capture(count, device)
    for n, power in enumerate(POWERS):
        for k in (TIMES.index(t) for t in times):
            value, wrong = law(study, power, TIMES[k])
            for m, start in enumerate(STARTS):
                expect_law(
                    f"share held for {TIMES[k]:g} s from {start:g} µm at {power:g} mW",
                    held[n, m, k],
                    value[m],
                    np.sqrt(max(value[m] * (1.0 - value[m]), 1.0 / count) / count),
                    bias=STEP * (1.0 - value[m]) + wrong[m],
                )


@pytest.mark.validate
def test_share_held_in_a_tabulated_trap(expect_law, device):
    """∂P/∂t = (F/γ)·∇P + D∇²P, P = 1 at first and 0 where the trap ends: over power and start, at three times.

    Source: Gardiner 2009, Stochastic Methods, §5.5.
    """
    check(expect_law, device, 16_384, TIMES)
