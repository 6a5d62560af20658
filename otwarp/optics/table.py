"""Force tables: the exact optical field of one beam and sphere as a ladder of (ρ, z) grids.

Why two dimensions hold the whole field. In the beam's cylindrical coordinates the sphere's position enters a multipole
coefficient of helicity σ through exp(−i(m − σ − ℓ)φ) alone, and the force is a sum of products of two coefficients with
equal m (or m + 1, with the factor that turns F_x + iF_y into F_ρ + iF_φ). Products of equal helicities do not depend on
φ, products of opposite ones on exp(±2iφ): F_ρ, F_φ, F_z are a constant plus cos 2φ and sin 2φ terms, exactly.

- one helicity (circular polarization): the constant, one layer (F_ρ, F_φ, F_z);
- both, no vortex: with φ measured from the major axis of the polarization, mirror symmetry leaves cos 2φ in F_ρ and F_z
  and sin 2φ in F_φ, a second layer;
- both, with a vortex: the remaining sin 2φ, sin 2φ and cos 2φ make a third.

Far from the focus the force falls as 1/d² only, and its features widen. So grids are nested: level l serves distances
up to radius·2^l, the last one up to the cutoff, where the force is within the tolerance of zero. How nodes are laid out
and levels blended is described in `otwarp.laws.table`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from otwarp.errors import InputError
from otwarp.laws.table import BLEND, STENCILS, Interpolation, coordinates, layer_factors
from otwarp.optics.analysis import TrapProperties
from otwarp.optics.beam import Beam
from otwarp.optics.mie import Particle

LOWEST_TOLERANCE, HIGHEST_TOLERANCE = 1e-5, 0.1


def check_accuracy(tolerance: float, interpolation: str) -> None:
    """Refuse what no table can be made to.

    Raises:
        InputError: A tolerance out of range, or an unknown interpolation.
    """
    if not LOWEST_TOLERANCE <= tolerance <= HIGHEST_TOLERANCE:
        allowed = f"{LOWEST_TOLERANCE:g} to {HIGHEST_TOLERANCE:g}"
        raise InputError(f"table tolerance is {tolerance:g}; allowed: {allowed}")
    if interpolation not in ("bilinear", "bicubic"):
        raise InputError(f"table interpolation is {interpolation!r}; allowed: bilinear, bicubic")


def layer_count(beam: Beam) -> int:
    """Layers of a table for this beam: 1, 2 or 3."""
    if min(abs(e) for e in beam.helicities()) < 1e-12:
        return 1
    return 2 if beam.charge == 0 else 3


def major_axis(beam: Beam) -> float:
    """Azimuth of the major axis of the polarization ellipse [rad], from which a table's φ is measured."""
    x, y = beam.jones
    return 0.5 * math.atan2(2.0 * (x * y.conjugate()).real, abs(x) ** 2 - abs(y) ** 2)


def smoothstep(x: np.ndarray) -> np.ndarray:
    """0 below 0, 1 above 1, with a continuous first derivative."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


@dataclass(frozen=True, eq=False)
class TableLevel:
    """One grid.

    Attributes:
        radius: Distance from the focus up to which the grid reaches, and serves [µm].
        spacing: Of its nodes, along ρ and z [µm].
        node: (rows, columns, layers, 3) float32: values of Q for bilinear, B-spline coefficients for bicubic.
        cut: Distance at which the force is made to end before the grid does [µm].
    """

    radius: float
    spacing: float
    node: np.ndarray
    cut: float = math.inf

    @property
    def end(self) -> float:
        """Distance from the focus up to which it serves [µm]."""
        return min(self.radius, self.cut)


@dataclass(frozen=True, eq=False, kw_only=True)
class ForceTable:
    """Tabulated force of a beam on a sphere.

    Attributes:
        beam, sphere: What it holds for.
        tolerance: Bound on the error, relative to the peak force.
        interpolation: `bilinear` (continuous) or `bicubic` (B-splines: continuous second derivative within a level,
            first derivative between levels).
        peak: Largest |Q|.
        error: Largest error found on points that the build never saw, over `peak`.
        properties: Equilibrium, stiffness, escape at 1 mW, or None if the beam does not hold this sphere.
        steepest: Steepest restoring slope anywhere in the finest level at 1 mW [pN/µm]; it limits the time step.
        levels: From the finest outward.
        beyond: Largest |Q| where a cut begins, over `peak`; 0 for a whole table, which ends where the tolerance
            allows.
    """

    beam: Beam
    sphere: Particle
    tolerance: float
    interpolation: Interpolation
    peak: float
    error: float
    properties: TrapProperties | None
    steepest: float
    levels: tuple[TableLevel, ...]
    beyond: float = 0.0

    @property
    def cutoff(self) -> float:
        """Distance from the focus beyond which the tabulated force is zero [µm]."""
        return self.levels[-1].end

    @property
    def layers(self) -> int:
        """Azimuthal components that a node has, as `layer_count` of the beam: 1, 2 or 3."""
        return self.levels[0].node.shape[2]

    def cut(self, reach: float) -> ForceTable:
        """The table without what a sphere within `reach` of the focus does not need [µm].

        From there on the force fades to zero, which it reaches at `reach`/`BLEND`; no sphere is held beyond.
        """
        end = reach / BLEND
        if end >= self.cutoff:
            return self
        kept = next(n for n, level in enumerate(self.levels) if level.radius >= end)
        levels = (*self.levels[:kept], replace(self.levels[kept], cut=end))
        turns = np.linspace(0.0, np.pi, 181)
        rim = reach * np.stack([np.sin(turns), 0.0 * turns, np.cos(turns)], axis=1)
        largest = np.linalg.norm(self.force(rim), axis=1).max()
        about = self.properties
        if about is not None:
            about = replace(about, escape_distance=tuple(min(d, end) for d in about.escape_distance))
        return replace(self, levels=levels, beyond=float(largest / self.peak), properties=about)

    @property
    def size(self) -> int:
        """Bytes of the nodes."""
        return sum(level.node.nbytes for level in self.levels)

    def force(self, points: np.ndarray) -> np.ndarray:
        """Q (n, 3) at sphere centres `points` (n, 3) from the focus [µm], in float64: the twin of the kernels' term."""
        turn = major_axis(self.beam)
        x = points[:, 0] * math.cos(turn) + points[:, 1] * math.sin(turn)
        y = points[:, 1] * math.cos(turn) - points[:, 0] * math.sin(turn)
        z = points[:, 2]
        rho = np.hypot(x, y)
        safe = np.where(rho > 0.0, rho, 1.0)
        cosine, sine = np.where(rho > 0.0, x / safe, 1.0), y / safe
        out = np.zeros((len(points), 3))
        q = np.hypot(rho, z)
        inner = 0.0
        for n, level in enumerate(self.levels):
            start, end = BLEND * inner, level.end
            inside = (q >= start) & (q < end)
            weight = 1.0 - blend_weight(q[inside], end)
            if n > 0:
                weight = weight * blend_weight(q[inside], inner)
            local = self._level(level, rho[inside], z[inside], cosine[inside], sine[inside])
            out[inside] += weight[:, None] * local
            inner = end
        across = out[:, 0] * cosine - out[:, 1] * sine, out[:, 0] * sine + out[:, 1] * cosine
        return np.stack(
            [
                across[0] * math.cos(turn) - across[1] * math.sin(turn),
                across[0] * math.sin(turn) + across[1] * math.cos(turn),
                out[:, 2],
            ],
            axis=1,
        )

    def _level(
        self, level: TableLevel, rho: np.ndarray, z: np.ndarray, cosine: np.ndarray, sine: np.ndarray
    ) -> np.ndarray:
        """(n, 3) F_ρ, F_φ, F_z of one level."""
        u, v = coordinates(rho, z, level.spacing, level.radius)
        i, j = u.astype(int), v.astype(int)
        first, weights = STENCILS[self.interpolation]
        wu, wv = weights(u - i), weights(v - j)
        total = np.zeros((len(rho), *level.node.shape[2:]))
        for b, row in enumerate(wv, first):
            for a, column in enumerate(wu, first):
                total += (row * column)[:, None, None] * level.node[j + b, i + a]
        return combine(total, cosine, sine)


def blend_weight(distance: np.ndarray, radius: float) -> np.ndarray:
    """Share of what lies beyond `radius`: 0 up to `BLEND`·radius, 1 from radius on; a smooth step in distance²."""
    return smoothstep(((distance / radius) ** 2 - BLEND**2) / (1.0 - BLEND**2))


def combine(layers: np.ndarray, cosine: np.ndarray, sine: np.ndarray) -> np.ndarray:
    """(n, 3) cylindrical components from (n, layers, 3) at azimuths with these cosines and sines."""
    out = layers[:, 0]
    for n, factors in enumerate(layer_factors(cosine, sine)[: layers.shape[1] - 1], 1):
        out = out + np.stack(factors, axis=1) * layers[:, n]
    return out


def steepest_slope(table: ForceTable) -> float:
    """Steepest restoring slope in the finest level [pN/µm at 1 mW]: the largest eigenvalue of −∂F_i/∂x_j, symmetrized.

    Off the axis it can be several times the stiffness at the equilibrium: at the rim of a large sphere.
    """
    radius, h = BLEND * table.levels[0].radius, 0.01 * table.beam.wavelength
    axis = np.linspace(0.0, radius, max(48, math.ceil(radius / (0.1 * table.beam.wavelength))))
    rho, z = (a.ravel() for a in np.meshgrid(axis, np.concatenate([-axis[:0:-1], axis]), indexing="ij"))
    turn = major_axis(table.beam)
    worst = 0.0
    # cos 2φ alone is extreme at 0 and 90°; with sin 2φ it may be anywhere
    sides = {1: np.zeros(1), 2: np.array([0.0, 0.5]), 3: np.arange(8) / 8.0}[table.layers] * math.pi
    for azimuth in turn + sides:
        points = np.stack([rho * math.cos(azimuth), rho * math.sin(azimuth), z], axis=1)
        slopes = [(table.force(points + h * e) - table.force(points - h * e)) / (2.0 * h) for e in np.eye(3)]
        jacobian = np.stack(slopes, axis=2)
        worst = max(worst, float(np.linalg.eigvalsh(-0.5 * (jacobian + jacobian.transpose(0, 2, 1))).max()))
    return worst * table.beam.force_scale
