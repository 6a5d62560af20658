"""Force of an optical trap on a sphere (the paper's eq. 1) and on a rigid body (eq. 2)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from otwarp.laws import TrapLaw
from otwarp.scene import Trap
from tests.reference.rotations import matrix


def curve(law: TrapLaw, d: float, model: str = "piecewise") -> float:
    """f(d) at the law's own power [pN], positive towards the trap; `harmonic` uses stiffness and cutoff alone."""
    if d >= law.cutoff:
        return 0.0
    if model == "harmonic" or d < law.threshold:
        return law.stiffness * d
    return law.inverse_square / d**2 + law.offset


def potential(law: TrapLaw, d: float, model: str = "piecewise") -> float:
    """∫₀ᵈ f at the law's own power [pN·µm], for the isotropic law."""
    d = min(d, law.cutoff)
    linear = d if model == "harmonic" else min(d, law.threshold)
    energy = 0.5 * law.stiffness * linear**2
    if d > linear:
        energy += law.inverse_square * (1.0 / linear - 1.0 / d) + law.offset * (d - linear)
    return energy


def scale(law: TrapLaw, radius: float) -> float:
    """Factor on distances: the law was fitted for a sphere of `law.radius`, and ray optics depends on d/r alone."""
    return law.radius / radius if law.radius > 0.0 else 1.0


def sphere_force(trap: Trap, focus: np.ndarray, power: float, centre: np.ndarray, radius: float) -> np.ndarray:
    """(3,) force of one trap on one sphere [pN], world axes; d is measured from the equilibrium point.

    isotropic:      F = −(P/P_law) f(|d| s) d̂
    radial + axial: F = −(P/P_r) f_r(ρ s_r) ρ̂ − (P/P_z) f_z(|z| s_z) sign(z) ẑ, and zero where |d| s ≥ both cutoffs
    """
    axis = matrix(np.asarray(trap.orientation))[:, 2]
    d = np.asarray(centre, dtype=float) - (np.asarray(focus, dtype=float) + trap.equilibrium * axis)
    radial, axial = trap.radial, trap.axial
    s = scale(radial, radius)
    distance = float(np.linalg.norm(d))
    if distance == 0.0:
        return np.zeros(3)
    if axial is None:
        return -power / radial.power * curve(radial, distance * s, trap.model) * d / distance
    s_axial = scale(axial, radius)
    if distance * s >= max(radial.cutoff, axial.cutoff):
        return np.zeros(3)
    z = float(d @ axis)
    across = d - z * axis
    rho = float(np.linalg.norm(across))
    force = -power / axial.power * curve(axial, abs(z) * s_axial, trap.model) * np.sign(z) * axis
    if rho > 0.0:
        force = force - power / radial.power * curve(radial, rho * s, trap.model) * across / rho
    return force


def body_wrench(
    traps: Iterable[tuple[Trap, np.ndarray, float]],
    position: np.ndarray,
    orientation: np.ndarray,
    reference: np.ndarray,
    spheres: Iterable[tuple[np.ndarray, float]],
) -> tuple[np.ndarray, np.ndarray]:
    """Force [pN] and torque about the reference point [pN·µm] on a rigid body, summed over traps and spheres.

    Args:
        traps: (trap, focus (3,), power) of each.
        position: (3,) reference point in the world [µm].
        orientation: Quaternion of the body's frame.
        reference: (3,) reference point in the body's frame [µm].
        spheres: (offset (3,) in the body's frame, radius) of each trapped sphere [µm].
    """
    force, torque, spheres = np.zeros(3), np.zeros(3), list(spheres)
    for trap, focus, power in traps:
        for offset, radius in spheres:
            arm = matrix(orientation) @ (np.asarray(offset, dtype=float) - reference)
            f = sphere_force(trap, focus, power, position + arm, radius)
            force, torque = force + f, torque + np.cross(arm, f)
    return force, torque


def limited_focus(now: np.ndarray, wanted: np.ndarray, speed_limit: float, time_step: float) -> np.ndarray:
    """(3,) focus after one step towards `wanted` at no more than `speed_limit` [µm/s]."""
    way = np.asarray(wanted, dtype=float) - now
    distance = float(np.linalg.norm(way))
    reach = speed_limit * time_step
    return np.array(wanted, dtype=float) if distance <= reach else now + way * (reach / distance)
