"""By how much a step makes gaps in contact wrong, and whether bodies of a scene come to touch at all.

A contact draws the least gap of its path within a step, exactly for a hard wall alone (`kernels.contact.excursion`).
Several contacts of one body draw each for itself, though the body has one path, and each sees the others' push as if it
lasted all along the step. That keeps them too far apart: in an emulation in one dimension, of a wall, a bead and a bead
with forces of any signs, mean gaps are up to 10 % too large, and gaps below a step's spread s up to 8 % too few. Both
grow with φ = F·s/k_BT, F the force that presses, as its root at first, and hardly from φ = 2 on
(`tests/simulation/time_step/test_contact_errors.py`). Eight beads in a box show the same. It falls with the fourth root
of the step, so none is shortened for it: it is reported.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.forces.force import Load
from otwarp.scene import Scene
from otwarp.scene.check.overlap import colliding_spheres, mesh_distance, signed_distance
from otwarp.scene.period import nearest
from otwarp.simulation.time_step.edges import REACHED
from otwarp.simulation.time_step.observables import ErrorSource
from otwarp.simulation.time_step.relaxation import TrapRelaxation
from otwarp.units import BOLTZMANN

ONE = 0.04
"""Largest relative error of the mean gap of a body with one contact, hard or soft, from φ = 1 on, and less below: what
`tests/simulation/test_contact_thermal.py` finds at k·dt/γ = 0.2, and the stability map on soft floors."""

SEVERAL, MOST = 0.075, 0.11
"""The same of bodies with several contacts over √φ, and at most."""

ALONG = 0.25
"""Stiffness of a trap along its beam over that across, at least."""


def in_contact(
    scene: Scene,
    moves: list[BodyMobility],
    values: Mapping[str, np.ndarray],
    relaxation: TrapRelaxation,
    powers: np.ndarray,
    loads: list[Load],
) -> list[ErrorSource]:
    """Errors of gaps between bodies and what traps, weight and other steady forces press them on.

    Args:
        values: The `(1|W, …)` parameters of the scene.
        relaxation: Rates in the traps.
        powers: (T,) of the traps [mW].
        loads: Per body, how strong all forces but traps are.
    """
    contacts = most_contacts(scene, travels(scene, values, relaxation, powers, loads))
    energy = BOLTZMANN * float(values["medium_temperature"].max())
    if contacts == 0 or energy == 0.0:
        return []
    rate = relaxation.fastest(powers)[0]
    viscosity = float(values["medium_viscosity"].min())
    # of a trap the force where thermal motion of 30 k_B T comes to
    ratios = [4.0 * REACHED * rate]
    for load, move in zip(loads, moves, strict=True):
        mobility = float(np.linalg.norm(move.mobility[:3, :3], 2)) / viscosity
        ratios.append(2.0 * load.force**2 * mobility / energy)
    worst = max(ratios)
    if worst == 0.0:
        return []

    def error(step: float) -> float:
        pressed = math.sqrt(worst * step)
        return min(MOST, SEVERAL * math.sqrt(pressed)) if contacts > 1 else ONE * min(1.0, pressed)

    return [ErrorSource(name="contact", error=error, longest=math.inf, limit="gaps in contact")]


def travels(
    scene: Scene,
    values: Mapping[str, np.ndarray],
    relaxation: TrapRelaxation,
    powers: np.ndarray,
    loads: list[Load],
) -> np.ndarray:
    """(B,) how far bodies come from where they start, as authored [µm]: with the trap that holds them, else anywhere.

    Around a focus as far as thermal motion of 30 k_B T and steady forces carry them; arguments as `in_contact`.
    """
    far = np.full(len(scene.bodies), np.inf)
    thermal = 2.0 * REACHED * BOLTZMANN * float(values["medium_temperature"].max())
    ends = np.minimum(values["trap_cutoff"], values["trap_axial_cutoff"]).min(axis=0)
    for mode in relaxation.modes:
        for t in mode.acting:
            trap = scene.traps[t]
            least = min(float(values["trap_power"][:, t].min()), float(trap.power.values.min()))
            stiffness = ALONG * float(relaxation.stiffness[t]) * min(least, float(powers[t]))
            if stiffness == 0.0:
                continue
            aside = math.sqrt(thermal / stiffness) + loads[mode.body].force / stiffness
            if aside < ends[t]:
                path = np.concatenate([values["trap_position"][:, t], trap.position.values])
                way = np.linalg.norm(path - np.array(scene.bodies[mode.body].position), axis=1)
                reached = aside + float(way.max())
                far[mode.body] = reached if np.isinf(far[mode.body]) else max(far[mode.body], reached)
    return far


def most_contacts(scene: Scene, travel: np.ndarray) -> int:
    """How many contacts a body may come to have at once, 2 standing for more; `travel` as `travels`.

    A body of several spheres or rods may lie on two of them.
    """
    owners, centres, radii = colliding_spheres(scene.bodies)
    bodies = np.unique(owners)
    partners = len(bodies) - 1 + len(scene.obstacles)
    if not len(bodies) or partners == 0:
        return 0
    if np.isinf(travel[bodies]).any():
        return 2 if partners > 1 or len(owners) > len(bodies) else 1
    grown = radii + travel[owners]
    met: dict[int, int] = dict.fromkeys(bodies.tolist(), 0)
    for b in met:
        own = owners == b
        apart = np.linalg.norm(nearest(centres[own][:, None] - centres[None], scene.settings.period), axis=2)
        touched = (apart < grown[own][:, None] + grown).any(axis=0) & ~own
        met[b] += len(np.unique(owners[touched]))
    for obstacle in scene.obstacles:
        moved = obstacle.position.values - obstacle.position.at(0.0)
        reach = grown + float(np.linalg.norm(moved, axis=1).max(initial=0.0))
        distance = (mesh_distance if obstacle.shape == "mesh" else signed_distance)(obstacle, centres, reach)
        for b in np.unique(owners[distance < reach]).tolist():
            met[b] += 1
    several = [n > 1 or (n == 1 and np.count_nonzero(owners == b) > 1) for b, n in met.items()]
    return 2 if any(several) else int(any(met.values()))
