"""Force laws of traps in plain floats: eq. 1 in one or two curves, and tables.

Every law sums over spheres at once, so that a servo period makes one call per trap. Forces are per mW [pN], for a
displacement from the focus to the sphere's centre [µm]. They are the terms of `otwarp.kernels.optics.trap_laws` and
`otwarp.kernels.optics.force_table` with the same operations in the same order: the kernels in float64, compiled
(`force.compiled`), have the same bits. A table's nested (ρ, z) grids are laid out as in `otwarp.laws.table`; its nodes
lie in `array`s of float32, one after another, layer by layer, component by component.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, Vec3
from otwarp.laws.table import BLEND, layer_factors
from otwarp.laws.trap_law import PER_POWER, TrapLaw

UPWARD: Vec3 = (0.0, 0.0, 1.0)
"""Direction in which beams travel unless a scene turns them."""


class Law(Protocol):
    """Force of a trap on spheres."""

    def pull(self, x: float, y: float, z: float, spheres: Sequence[Vec3]) -> Vec3:
        """Sum of the forces per mW on `spheres` [µm] in a trap whose focus is at x, y, z [µm]."""
        ...


def check_curve(curve: TrapLaw) -> None:
    """Refuse a curve that is no curve at 1 mW.

    Raises:
        InputError: Stiffness or an outer constant not finite, distances out of order, or another power.
    """
    if curve.power != 1.0:
        raise InputError(f"trap law power is {curve.power!r} mW; allowed: 1, as `per_mw` gives")
    for name in PER_POWER:
        if not math.isfinite(getattr(curve, name)):
            raise InputError(f"trap law {name} is {getattr(curve, name)!r}; allowed: finite numbers")
    if not 0.0 <= curve.threshold <= curve.cutoff:
        raise InputError(f"trap law threshold is {curve.threshold!r}; allowed: 0 to its cutoff, {curve.cutoff!r} µm")


def check_axis(axis: Vec3) -> None:
    """Refuse a beam axis that is not a unit vector."""
    if not abs(math.hypot(*axis) - 1.0) < 1e-5:
        raise InputError(f"beam axis is {axis!r}; allowed: a unit vector")


@dataclass(frozen=True)
class IsotropicLaw:
    """Eq. 1 in all directions: F = −f(d)·d̂.

    Attributes:
        curve: f per mW.
        axis: Of the beam, unit vector.
        equilibrium: Where f vanishes, from the focus along the axis [µm].

    Raises:
        InputError: A curve or axis that is none.
    """

    curve: TrapLaw
    axis: Vec3 = UPWARD
    equilibrium: float = 0.0

    def __post_init__(self) -> None:
        check_curve(self.curve)
        check_axis(self.axis)

    def pull(self, x: float, y: float, z: float, spheres: Sequence[Vec3]) -> Vec3:
        """See `Law.pull`."""
        curve, (ax, ay, az), e = self.curve, self.axis, self.equilibrium
        x, y, z = x + e * ax, y + e * ay, z + e * az
        inner, reach = curve.threshold * curve.threshold, curve.cutoff * curve.cutoff
        fx = fy = fz = 0.0
        for u, v, w in spheres:
            u, v, w = u - x, v - y, w - z
            d2 = u * u + v * v + w * w
            # written so that a NaN is within reach, and is seen in the sum
            if d2 >= reach:
                continue
            ratio = curve.stiffness
            if d2 >= inner:
                if not d2:
                    continue
                per_distance = 1.0 / math.sqrt(d2)
                ratio = (curve.inverse_square * per_distance * per_distance + curve.offset) * per_distance
            fx -= ratio * u
            fy -= ratio * v
            fz -= ratio * w
        return fx, fy, fz


@dataclass(frozen=True)
class SplitLaw:
    """Eq. 1 with separate curves across and along the beam: F = −f_r(ρ)·ρ̂ − f_z(|z|)·ẑ, 0 beyond the larger cutoff.

    Attributes:
        radial, axial: f_r, f_z per mW.
        axis, equilibrium: As `IsotropicLaw`.

    Raises:
        InputError: A curve or axis that is none.
    """

    radial: TrapLaw
    axial: TrapLaw
    axis: Vec3 = UPWARD
    equilibrium: float = 0.0

    def __post_init__(self) -> None:
        check_curve(self.radial)
        check_curve(self.axial)
        check_axis(self.axis)

    def pull(self, x: float, y: float, z: float, spheres: Sequence[Vec3]) -> Vec3:
        """See `Law.pull`."""
        (ax, ay, az), e, radial, axial = self.axis, self.equilibrium, self.radial, self.axial
        x, y, z = x + e * ax, y + e * ay, z + e * az
        reach = max(radial.cutoff, axial.cutoff) ** 2
        fx = fy = fz = 0.0
        for u, v, w in spheres:
            u, v, w = u - x, v - y, w - z
            if u * u + v * v + w * w >= reach:
                continue
            h = u * ax + v * ay + w * az
            # across the beam
            u, v, w = u - h * ax, v - h * ay, w - h * az
            fr = radial.ratio(u * u + v * v + w * w)
            along = axial.ratio(h * h) * h
            fx -= fr * u + along * ax
            fy -= fr * v + along * ay
            fz -= fr * w + along * az
        return fx, fy, fz


@dataclass(frozen=True)
class ForceGrid:
    """One level of a table.

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


class Level(NamedTuple):
    """A grid as interpolation reads it, in the numbers of `otwarp.kernels.core.table_data.GridLevel`.

    Attributes:
        node: Forces per mW [pN], 3·layers numbers per node.
        columns: Nodes along ρ.
        end2: Squared distance up to which it serves [µm²].
        per_spacing: 1/spacing [1/µm].
        middle: Cells below the focus.
    """

    node: array[float]
    columns: int
    end2: float
    per_spacing: float
    middle: float


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
        """See `Law.pull`."""
        ax, ay, az = self.axis
        sx, sy, sz = self.side
        ux, uy, uz = ay * sz - az * sy, az * sx - ax * sz, ax * sy - ay * sx
        reach = self.reach2
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

    def __hash__(self) -> int:
        # of what is short; `==` compares the nodes as well
        return hash((self.layers, self.cubic, self.scale, self.side, self.axis))

    @property
    def reach2(self) -> float:
        """Squared distance from the focus beyond which it pulls no more [µm²]."""
        return self.grids[-1].end * self.grids[-1].end

    @cached_property
    def levels(self) -> tuple[Level, ...]:
        """What interpolation reads of the grids: forces per mW in float64, as `otwarp.kernels` keep them."""
        found = []
        for grid in self.grids:
            per_spacing = 1.0 / grid.spacing
            node = array("d", [self.scale * q for q in grid.node])
            found.append(Level(node, grid.columns, grid.end * grid.end, per_spacing, grid.radius * per_spacing))
        return tuple(found)

    def beam_force(self, x: float, y: float, z: float) -> Vec3:
        """Force per mW [pN] on a sphere at x, y, z [µm] in the beam's frame, x along the polarization's major axis."""
        rho2 = x * x + y * y
        d2 = rho2 + z * z
        if d2 != d2:
            return math.nan, math.nan, math.nan
        # on the axis F_ρ and F_φ vanish in proportion to ρ, so that any direction serves
        per_rho = 1.0 / math.sqrt(max(rho2, 1e-20))
        rho, c, s = math.sqrt(rho2), x * per_rho, y * per_rho
        finest = self.levels[0]
        inner = BLEND * self.grids[0].end
        if d2 < inner * inner:
            radial, turning, axial = self._level(finest, rho, z, c, s)
        else:
            radial, turning, axial = self._blended(d2, rho, z, c, s)
        return radial * c - turning * s, radial * s + turning * c, axial

    def _blended(self, d2: float, rho: float, z: float, c: float, s: float) -> Vec3:
        """(F_ρ, F_φ, F_z) of the level that reaches as far as d2, and of the next one in its outer fifth."""
        n, last = 0, len(self.levels) - 1
        while n < last and d2 >= self.levels[n].end2:
            n += 1
        here = self.levels[n]
        if d2 >= here.end2:
            return ZERO
        beyond = min(max((d2 / here.end2 - BLEND * BLEND) * (1.0 / (1.0 - BLEND * BLEND)), 0.0), 1.0)
        beyond = beyond * beyond * (3.0 - 2.0 * beyond)
        k = 1.0 - beyond
        fr, ft, fa = self._level(here, rho, z, c, s)
        radial, turning, axial = k * fr, k * ft, k * fa
        if beyond > 0.0 and n < last:
            fr, ft, fa = self._level(self.levels[n + 1], rho, z, c, s)
            radial, turning, axial = radial + beyond * fr, turning + beyond * ft, axial + beyond * fa
        return radial, turning, axial

    def _level(self, level: Level, rho: float, z: float, c: float, s: float) -> Vec3:
        """(F_ρ, F_φ, F_z) per mW [pN] of one level at azimuth with this cosine and sine."""
        u, v = rho * level.per_spacing, z * level.per_spacing + level.middle
        i, j = int(u), int(v)
        if self.cubic:
            return self._bicubic(level, j * level.columns + i, u - i, v - j, c, s)
        u, v = u - i, v - j
        first = (j + 1) * level.columns + i + 1
        second, both = first + level.columns, u * v
        a, b, d = 1.0 - u - (v - both), u - both, v - both
        if self.layers == 1:
            # four nodes of three components, spelled out: this is what a servo period is made of
            node, n, m = level.node, 3 * first, 3 * second
            return (
                a * node[n] + b * node[n + 3] + d * node[m] + both * node[m + 3],
                a * node[n + 1] + b * node[n + 4] + d * node[m + 1] + both * node[m + 4],
                a * node[n + 2] + b * node[n + 5] + d * node[m + 2] + both * node[m + 5],
            )
        at, factors = self._node, layer_factors(c, s)
        nodes = (at(level, n, factors) for n in (first, first + 1, second, second + 1))
        return tuple(a * p + b * q + d * r + both * t for p, q, r, t in zip(*nodes, strict=True))  # type: ignore[return-value]

    def _bicubic(self, level: Level, n: int, u: float, v: float, c: float, s: float) -> Vec3:
        """The same by cubic B-splines: sixteen nodes from n on, for the offsets u, v in a cell."""
        (a, b, d, e), factors = _cubic_weights(u), layer_factors(c, s)
        radial = turning = axial = 0.0
        for weight in _cubic_weights(v):
            if self.layers == 1:
                node, m = level.node, 3 * n
                radial += weight * (a * node[m] + b * node[m + 3] + d * node[m + 6] + e * node[m + 9])
                turning += weight * (a * node[m + 1] + b * node[m + 4] + d * node[m + 7] + e * node[m + 10])
                axial += weight * (a * node[m + 2] + b * node[m + 5] + d * node[m + 8] + e * node[m + 11])
            else:
                p, q, r, t = (self._node(level, n + k, factors) for k in range(4))
                radial += weight * (a * p[0] + b * q[0] + d * r[0] + e * t[0])
                turning += weight * (a * p[1] + b * q[1] + d * r[1] + e * t[1])
                axial += weight * (a * p[2] + b * q[2] + d * r[2] + e * t[2])
            n += level.columns
        return radial, turning, axial

    def _node(self, level: Level, n: int, factors: tuple[Vec3, Vec3]) -> Vec3:
        """Node n of a polarized beam at the azimuth of these factors, all layers together."""
        node, m = level.node, 3 * self.layers * n
        (a, b, d), (e, f, g) = factors
        if self.layers == 2:
            return node[m] + a * node[m + 3], node[m + 1] + b * node[m + 4], node[m + 2] + d * node[m + 5]
        return (
            node[m] + (a * node[m + 3] + e * node[m + 6]),
            node[m + 1] + (b * node[m + 4] + f * node[m + 7]),
            node[m + 2] + (d * node[m + 5] + g * node[m + 8]),
        )


def _cubic_weights(t: float) -> tuple[float, float, float, float]:
    """`otwarp.laws.table.cubic_weights` in the order of operations of `otwarp.kernels.optics.force_table`."""
    s = 1.0 - t
    t2, s2 = t * t, s * s
    return (
        s * s2 * (1.0 / 6.0),
        2.0 / 3.0 - t2 + 0.5 * t * t2,
        2.0 / 3.0 - s2 + 0.5 * s * s2,
        t * t2 * (1.0 / 6.0),
    )
