"""A flow as data: velocities on the nodes of a regular grid, between which they vary trilinearly; NumPy."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from otwarp.errors import InputError
from otwarp.scene.track import ByValue

Vec3 = tuple[float, float, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class FlowGrid(ByValue):
    """Velocities on a regular grid in the frame of the flow's prim; outside the grid the liquid is at rest.

    Attributes:
        low: Place of the first node [µm].
        spacing: Distance of the nodes along x, y and z [µm].
        velocity: (nx, ny, nz, 3) [µm/s], at least 2 nodes along each axis.
        digest: SHA-256 of the velocities, which stands for them in a scene's digest.

    Raises:
        InputError: Other shapes, a spacing that is not positive, a number that is not finite.
    """

    low: Vec3
    spacing: Vec3
    velocity: np.ndarray = field(repr=False)
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        given = np.asarray(self.velocity)
        if given.ndim != 4 or given.shape[3] != 3 or min(given.shape) < 2 or given.dtype.kind not in "iuf":
            raise InputError(
                f"FlowGrid: velocity = shape {given.shape} of {given.dtype}: must be numbers (nx, ny, nz, 3), n ≥ 2"
            )
        values = np.ascontiguousarray(given, dtype=np.float64)
        if np.any(bad := ~np.isfinite(values)):
            place = "".join(f"[{i}]" for i in np.argwhere(bad)[0])
            raise InputError(f"FlowGrid: velocity{place} = {values[bad][0]}: must be finite")
        if not (
            np.all(np.isfinite(self.low)) and np.all(np.array(self.spacing) > 0.0) and np.all(np.isfinite(self.spacing))
        ):
            raise InputError(
                f"FlowGrid: low, spacing = {self.low}, {self.spacing}: must be finite, spacing in (0, inf) µm"
            )
        object.__setattr__(self, "velocity", values)
        object.__setattr__(self, "digest", hashlib.sha256(values.tobytes()).hexdigest())

    @property
    def nodes(self) -> tuple[int, int, int]:
        """Nodes along x, y and z."""
        nx, ny, nz, _ = self.velocity.shape
        return nx, ny, nz

    @property
    def high(self) -> np.ndarray:
        """(3,) place of the last node [µm]."""
        return np.array(self.low) + np.array(self.spacing) * (np.array(self.nodes) - 1)

    @cached_property
    def gradient(self) -> np.ndarray:
        """(nx, ny, nz, 3, 3) ∂u_i/∂x_j on the nodes [1/s], of second order."""
        parts = [
            np.gradient(self.velocity, h, axis=axis, edge_order=2 if n > 2 else 1)
            for axis, (h, n) in enumerate(zip(self.spacing, self.nodes, strict=True))
        ]
        return np.stack(parts, axis=-1)

    @cached_property
    def curl(self) -> np.ndarray:
        """(nx, ny, nz, 3) ∇×u on the nodes [1/s]."""
        g = self.gradient
        return np.stack(
            [g[..., 2, 1] - g[..., 1, 2], g[..., 0, 2] - g[..., 2, 0], g[..., 1, 0] - g[..., 0, 1]], axis=-1
        )

    @cached_property
    def laplacian(self) -> np.ndarray:
        """(nx, ny, nz, 3) ∇²u on the nodes [1/(µm·s)]; the outermost have that of their neighbours."""
        total = np.zeros_like(self.velocity)
        for axis, h in enumerate(self.spacing):
            u = np.moveaxis(self.velocity, axis, 0)
            if len(u) > 2:
                second = (u[2:] - 2.0 * u[1:-1] + u[:-2]) / h**2
                total += np.moveaxis(np.concatenate([second[:1], second, second[-1:]]), 0, axis)
        return total

    @cached_property
    def divergence(self) -> tuple[float, float]:
        """Root mean square of ∇·u over that of |∇u|, and the largest |∇·u| [1/s]; both 0 of a liquid that is kept."""
        div = np.trace(self.gradient, axis1=-2, axis2=-1)
        size = float(np.sqrt((self.gradient**2).sum(axis=(-2, -1)).mean()))
        return (float(np.sqrt((div**2).mean())) / size if size > 0.0 else 0.0), float(np.abs(div).max())

    @property
    def fastest(self) -> float:
        """Largest |u| [µm/s]."""
        return float(np.linalg.norm(self.velocity, axis=-1).max())

    def at(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) velocities [µm/s] at points (n, 3) of the grid's frame [µm]; 0 outside the grid."""
        g = (points - np.array(self.low)) / np.array(self.spacing)
        last = np.array(self.nodes) - 1
        inside = np.all((g >= 0.0) & (g <= last), axis=1)
        cell = np.clip(np.floor(g).astype(int), 0, last - 1)
        part = g - cell
        out = np.zeros((len(points), 3))
        for corner in np.ndindex(2, 2, 2):
            i, j, k = (cell + np.array(corner)).T
            weight = np.where(np.array(corner), part, 1.0 - part).prod(axis=1)
            out += weight[:, None] * self.velocity[i, j, k]
        return np.where(inside[:, None], out, 0.0)
