"""Coupled bodies in float64: the whole mobility matrix of a world, built block by block without the hydrodynamics room.

The pair tensors come from their definition: the Oseen tensor averaged over the surface of both spheres, by the
differential form of that average where the spheres are apart and by quadrature over the surfaces where they overlap.
"""

from __future__ import annotations

import itertools

import numpy as np

STEP = 1e-4
"""Displacement for differences, relative to the smaller radius: their error is its square."""


def oseen(way: np.ndarray) -> np.ndarray:
    """(..., 3, 3) of (..., 3) at unit viscosity [1/µm]."""
    r = np.linalg.norm(way, axis=-1)[..., None, None]
    return (np.eye(3) + way[..., :, None] * way[..., None, :] / r**2) / (8.0 * np.pi * r)


def apart(way: np.ndarray, a: float, b: float) -> np.ndarray:
    """(3, 3) (1 + (a² + b²)/6 ∇²) of the Oseen tensor, ∇² G = (I − 3r̂r̂)/4πr³ (Rotne & Prager 1969)."""
    r = float(np.linalg.norm(way))
    n = way / r
    laplacian = (np.eye(3) - 3.0 * np.outer(n, n)) / (4.0 * np.pi * r**3)
    return oseen(way) + (a * a + b * b) / 6.0 * laplacian


def surface_averaged(way: np.ndarray, a: float, b: float, points: int = 400) -> np.ndarray:
    """(3, 3) average of the flow of a sphere at the origin over the surface of another at `way`, at any distance.

    A uniformly forced surface of radius b drives (1 + b²/6 ∇²) G outside and 1/6πb within (Stokes); over the other
    surface this is averaged in shells of equal height about the axis, in which its angular part is known.
    """
    distance = float(np.linalg.norm(way))
    axis = way / distance if distance > 0.0 else np.array([0.0, 0.0, 1.0])
    # r² on the surface runs linearly with the height; the flow has a kink where it enters the other sphere
    kink = (b * b - distance**2 - a * a) / (2.0 * distance * a) if distance > 0.0 else -1.0
    ends = np.unique(np.clip([-1.0, kink, 1.0], -1.0, 1.0))
    x, weight = np.polynomial.legendre.leggauss(points)
    total = np.zeros((3, 3))
    for low, high in itertools.pairwise(ends):
        height = 0.5 * (high - low) * x + 0.5 * (high + low)
        along, across = distance + a * height, a * np.sqrt(1.0 - height**2)
        r = np.hypot(along, across)
        inside = r < b
        near = np.where(inside, b, r)
        iso = np.where(inside, 1.0 / (6.0 * np.pi * b), (1.0 + b * b / (3.0 * near**2)) / (8.0 * np.pi * near))
        radial = np.where(inside, 0.0, (1.0 - b * b / near**2) / (8.0 * np.pi * near))
        # r̂r̂ averaged about the axis
        cos2 = (along / near) ** 2
        mean_along, mean_across = iso + radial * cos2, iso + radial * 0.5 * (across / near) ** 2
        share = 0.5 * 0.5 * (high - low) * weight
        p, q = float(share @ mean_across), float(share @ (mean_along - mean_across))
        total += p * np.eye(3) + q * np.outer(axis, axis)
    return total


def pair_mobility(way: np.ndarray, a: float, b: float) -> np.ndarray:
    """(3, 3) whichever form serves."""
    return apart(way, a, b) if np.linalg.norm(way) > a + b else surface_averaged(way, a, b)


def divergence(way: np.ndarray, a: float, b: float) -> np.ndarray:
    """(3,) Σ_j ∂_j P_ij by differences [1/µm²]."""
    step = STEP * min(a, b)
    shifts = step * np.eye(3)
    columns = [(pair_mobility(way + s, a, b) - pair_mobility(way - s, a, b))[:, j] for j, s in enumerate(shifts)]
    return np.sum(columns, axis=0) / (2.0 * step)


def drag_radius(own: np.ndarray) -> float:
    """Radius of the sphere with the largest drag in any direction of a body with the mobility `own` (6, 6)."""
    return float(np.linalg.eigvalsh(np.linalg.inv(own)[:3, :3])[-1]) / (6.0 * np.pi)


def whole_mobility(position: np.ndarray, turn: list[np.ndarray], own: list[np.ndarray]) -> np.ndarray:
    """(6n, 6n) at unit viscosity, (velocity, angular velocity) of body after body, world axes.

    Args:
        position: (n, 3) centres of diffusion [µm].
        turn: n rotation matrices of the bodies.
        own: n (6, 6) mobilities in the bodies' axes; a lone sphere that does not turn has its rotation too.
    """
    n = len(own)
    total = np.zeros((n, 6, n, 6))
    radius = [drag_radius(m) for m in own]
    for i in range(n):
        both = np.kron(np.eye(2), turn[i])
        total[i, :, i, :] = both @ own[i] @ both.T
        for j in range(n):
            if i != j:
                total[i, :3, j, :3] = pair_mobility(position[i] - position[j], radius[i], radius[j])
    return total.reshape(6 * n, 6 * n)


def moves(whole: np.ndarray, load: np.ndarray, scale: float) -> np.ndarray:
    """(n, 6) displacements and rotations by the wrenches `load` (n, 6) in one step; `scale` = dt/η."""
    return (scale * whole @ load.ravel()).reshape(-1, 6)
