"""One time step of a rigid body about its centre of diffusion: explicit, and linearly implicit in its contacts.

Ermak & McCammon 1978, doi:10.1063/1.436761, with Δ = (Δx, Δθ) and mobility M = L Lᵀ in the body's axes.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tests.reference.rotations import exponential, matrix, multiply

Pose = tuple[np.ndarray, np.ndarray]


def to_body(orientation: np.ndarray, linear: np.ndarray, angular: np.ndarray) -> np.ndarray:
    """(6,) the two world vectors in the body's axes."""
    rotation = matrix(orientation)
    return np.concatenate([rotation.T @ linear, rotation.T @ angular])


def advance(position: np.ndarray, orientation: np.ndarray, move: np.ndarray) -> Pose:
    """Pose after a displacement and rotation vector `move` (6,) in the body's axes: q ← q ⊗ exp(Δθ)."""
    turned = multiply(orientation, exponential(move[3:]))
    return position + matrix(orientation) @ move[:3], turned / np.linalg.norm(turned)


def turning_variances(variances: np.ndarray) -> np.ndarray:
    """(3,) principal variances of the rotation vector of a step [rad²] from 2 D_r dt, right to second order."""
    out = np.array(variances, dtype=float)
    for k, s in enumerate(variances):
        i, j = variances[k - 1], variances[k - 2]
        out[k] += i * j / 4.0 - s * (i + j) / 6.0
    return out


def thermal_move(root: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """(6,) displacement and rotation vector by deviates ξ, in the body's axes; `root` (6, 6) with the covariance L Lᵀ.

    Rotations have the variances of `turning_variances`, and displacements are turned along by 1/√2 of the rotation.
    """
    along = root[3:, :3] @ root[3:, :3].T
    variance, axes = np.linalg.eigh(along + root[3:, 3:] @ root[3:, 3:].T)
    turning = np.linalg.cholesky((axes * turning_variances(variance)) @ axes.T - along)
    v, w = root[:3, :3] @ noise[:3], root[3:, :3] @ noise[:3] + turning @ noise[3:]
    angle = np.linalg.norm(w)
    if angle > 0.0:
        v = matrix(exponential(2.0 * np.arctan(angle / np.sqrt(8.0)) / angle * w)) @ v
    return np.concatenate([v, w])


def free_move(
    wrench: np.ndarray,
    mobility: np.ndarray,
    cholesky: np.ndarray,
    noise: np.ndarray,
    *,
    viscosity: float,
    energy: float,
    time_step: float,
    flow: np.ndarray | None = None,
) -> np.ndarray:
    """Δ = M F dt/η + noise + U_flow dt, (6,) in the body's axes; the noise as `thermal_move`.

    Args:
        wrench: (6,) force and torque about the reference point [pN, pN·µm].
        mobility: (6, 6) at unit viscosity.
        cholesky: (6, 6) L.
        noise: (6,) standard normal ξ.
        viscosity: η [pN·s/µm²].
        energy: k_B T [pN·µm].
        time_step: dt [s].
        flow: (6,) velocity of the force-free body [µm/s, rad/s].
    """
    scale = time_step / viscosity
    move = scale * (mobility @ wrench) + thermal_move(np.sqrt(2.0 * energy * scale) * cholesky, noise)
    return move if flow is None else move + time_step * flow


def flow_velocity(
    position: np.ndarray,
    orientation: np.ndarray,
    offsets: np.ndarray,
    coupling: np.ndarray,
    velocities: Iterable[tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    """(6,) Σ_i C_i (u_i, ω_i) in the body's axes, with (u_i, ω_i) the flow at each sphere in world axes."""
    return sum(
        (c @ to_body(orientation, u, w) for c, (u, w) in zip(coupling, velocities, strict=True)), start=np.zeros(6)
    )


def jacobian(orientation: np.ndarray, normal: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """(6,) J = (n, r × n) in the body's axes, of a contact at world `arm` from the reference with world `normal`."""
    return to_body(orientation, normal, np.cross(arm, normal))


def implicit_move(
    move: np.ndarray,
    resistance: np.ndarray,
    contacts: Iterable[tuple[float, float, np.ndarray]],
    *,
    viscosity: float,
    time_step: float,
) -> np.ndarray:
    """Δ from (R η/dt + Σ k J Jᵀ) Δ = R η/dt · Δ_free + Σ F J, (6,) in the body's axes.

    Args:
        move: (6,) Δ_free, the step without the contacts.
        resistance: (6, 6) R at unit viscosity.
        contacts: (force at the start, stiffness, J) of each [pN, pN/µm].
        viscosity: η [pN·s/µm²].
        time_step: dt [s].
    """
    drag = resistance * (viscosity / time_step)
    matrix_, right = drag.copy(), drag @ move
    for force, stiffness, j in contacts:
        matrix_ += stiffness * np.outer(j, j)
        right = right + force * j
    return np.linalg.solve(matrix_, right)
