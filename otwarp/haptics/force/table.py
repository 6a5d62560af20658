"""Tabulated trap forces in plain floats: nested (ρ, z) grids, as `otwarp.laws.table` lays them out.

Nodes lie in `array`s of float32, one after another, layer by layer, component by component.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.core.types import Vec3
from otwarp.haptics.force.law import UPWARD, check_axis
from otwarp.laws.table import BLEND, cubic_weights, layer_factors


@dataclass(frozen=True)
class ForceGrid:
    """One level.

    Attributes:
        spacing: Of its nodes along ρ and z [µm].
        radius: Half its height [µm].
        end: Distance from the focus up to which it serves [µm].
        columns: Nodes along ρ.
        node: float32, 3·layers numbers per node, rows along z.
    """

    spacing: float
    radius: float
    end: float
    columns: int
    node: array[float]


@dataclass(frozen=True)
class TableLaw:
    """Force of a beam on spheres from its table.

    Attributes:
        grids: Levels from the finest outward.
        layers: 1 for circular polarization, 2 for another, 3 with a vortex.
        cubic: Whether nodes are coefficients of cubic B-splines, else values for bilinear interpolation.
        scale: Force per mW of Q = 1, n/c [pN].
        side: Direction of the major axis of the polarization, across the beam; unit vector.
        axis: Of the beam; unit vector.

    Raises:
        InputError: An axis that is none, or not across the other.
    """

    grids: tuple[ForceGrid, ...]
    layers: int
    cubic: bool
    scale: float
    side: Vec3 = (1.0, 0.0, 0.0)
    axis: Vec3 = UPWARD

    def __post_init__(self) -> None:
        check_axis(self.axis)
        check_axis(self.side)
        if abs(sum(a * b for a, b in zip(self.axis, self.side, strict=True))) > 1e-5:
            raise InputError(f"polarization axis is {self.side!r}; allowed: one across the beam, {self.axis!r}")

    @classmethod
    def of(cls, table: Any, *, side: Vec3 | None = None, axis: Vec3 = UPWARD, turn: float = 0.0) -> TableLaw:
        """From an `otwarp.optics.ForceTable`, which this room may not import.

        Args:
            table: Has `levels`, `layers`, `interpolation` and `beam`.
            side: Direction of the polarization's major axis; None for `turn` from +X, for a beam along +Z.
            axis: Direction of the beam.
            turn: `otwarp.optics.table.major_axis` of the beam [rad].
        """
        grids = tuple(
            ForceGrid(
                float(level.spacing),
                float(level.radius),
                float(level.end),
                int(level.node.shape[1]),
                array("f", level.node.tobytes()),
            )
            for level in table.levels
        )
        scale = float(table.beam.force_scale / table.beam.power)
        if side is None:
            side = (math.cos(turn), math.sin(turn), 0.0)
        return cls(grids, int(table.layers), table.interpolation == "bicubic", scale, side, axis)

    def pull(self, x: float, y: float, z: float, spheres: Sequence[Vec3]) -> Vec3:
        """See `otwarp.haptics.force.law.Law.pull`."""
        ax, ay, az = self.axis
        sx, sy, sz = self.side
        ux, uy, uz = ay * sz - az * sy, az * sx - ax * sz, ax * sy - ay * sx
        reach = self.grids[-1].end ** 2
        fx = fy = fz = 0.0
        for u, v, w in spheres:
            u, v, w = u - x, v - y, w - z
            if u * u + v * v + w * w >= reach:
                continue
            fs, fu, fa = self.beam_force(sx * u + sy * v + sz * w, ux * u + uy * v + uz * w, ax * u + ay * v + az * w)
            fx += fs * sx + fu * ux + fa * ax
            fy += fs * sy + fu * uy + fa * ay
            fz += fs * sz + fu * uz + fa * az
        return fx, fy, fz

    def beam_force(self, x: float, y: float, z: float) -> Vec3:
        """Force per mW [pN] on a sphere at x, y, z [µm] in the beam's frame, x along the polarization's major axis."""
        if x != x or y != y or z != z:
            return math.nan, math.nan, math.nan
        rho = math.hypot(x, y)
        c, s = (x / rho, y / rho) if rho > 0.0 else (1.0, 0.0)
        d2 = rho * rho + z * z
        k, finest = self.scale, self.grids[0]
        if d2 < (BLEND * finest.end) ** 2:
            radial, turning, axial = self._level(finest, rho, z, c, s)
            return k * (radial * c - turning * s), k * (radial * s + turning * c), k * axial
        radial = turning = axial = 0.0
        inner = 0.0
        for grid in self.grids:
            if d2 >= grid.end * grid.end:
                inner = grid.end
                continue
            weight = 1.0 - _blend(d2, grid.end)
            if inner > 0.0:
                weight *= _blend(d2, inner)
            if weight > 0.0:
                fr, ft, fa = self._level(grid, rho, z, c, s)
                radial += weight * fr
                turning += weight * ft
                axial += weight * fa
            # the next level shares only the outer fifth of this one
            if d2 < (BLEND * grid.end) ** 2:
                break
            inner = grid.end
        return k * (radial * c - turning * s), k * (radial * s + turning * c), k * axial

    def _level(self, grid: ForceGrid, rho: float, z: float, c: float, s: float) -> Vec3:
        """(Q_ρ, Q_φ, Q_z) of one level at azimuth with this cosine and sine."""
        # `otwarp.laws.table.coordinates` without the call, which would be 5 % of a period
        u, v = rho / grid.spacing + 1.0, (z + grid.radius) / grid.spacing + 1.0
        i, j = int(u), int(v)
        u, v, width = u - i, v - j, 3 * self.layers
        if self.cubic:
            sums = _cubic_sums(grid, i, j, u, v, width)
        else:
            node, n = grid.node, (j * grid.columns + i) * width
            m = n + grid.columns * width
            d = u * v
            a, b, c0 = 1.0 - u - v + d, u - d, v - d
            if width == 3:
                # four nodes of three components, spelled out: this is what a servo period is made of
                return (
                    a * node[n] + b * node[n + 3] + c0 * node[m] + d * node[m + 3],
                    a * node[n + 1] + b * node[n + 4] + c0 * node[m + 1] + d * node[m + 4],
                    a * node[n + 2] + b * node[n + 5] + c0 * node[m + 2] + d * node[m + 5],
                )
            sums = [
                a * node[n + k] + b * node[n + width + k] + c0 * node[m + k] + d * node[m + width + k]
                for k in range(width)
            ]
        for n, factors in enumerate(layer_factors(c, s)[: self.layers - 1], 1):
            for k, factor in enumerate(factors):
                sums[k] += factor * sums[3 * n + k]
        return sums[0], sums[1], sums[2]


def _cubic_sums(grid: ForceGrid, i: int, j: int, u: float, v: float, width: int) -> list[float]:
    """Sums of sixteen coefficients for the offsets u, v in cell i, j."""
    node, across, sums = grid.node, cubic_weights(u), [0.0] * width
    for b, row in enumerate(cubic_weights(v), j - 1):
        n = (b * grid.columns + i - 1) * width
        for column in across:
            weight = row * column
            for k in range(width):
                sums[k] += weight * node[n + k]
            n += width
    return sums


def _blend(d2: float, radius: float) -> float:
    """Share of what lies beyond `radius`: a smooth step in distance² from `BLEND`·radius to radius."""
    x = min(max((d2 / (radius * radius) - BLEND * BLEND) / (1.0 - BLEND * BLEND), 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)
