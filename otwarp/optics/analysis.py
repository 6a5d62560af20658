"""What a force field means for a trap: equilibrium, stiffness, escape force, depth of the well."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from otwarp.errors import InputError
from otwarp.optics.beam import Beam
from otwarp.optics.exact import checked_points
from otwarp.optics.field import force
from otwarp.optics.mie import Particle

STEP = 0.01
"""Largest step of the central differences [µm]; Richardson extrapolation with half of it."""


ESCAPED = 0.05
"""Fraction of the largest restoring force below which a sphere counts as escaped: far from a beam a weak pull may last
for many micrometres without holding anything against thermal motion."""


@dataclass(frozen=True, kw_only=True)
class TrapProperties:
    """Properties of a trap for one sphere, at the beam's power.

    Attributes:
        equilibrium: Height of the stable point on the axis, from the focus [µm].
        others: Other stable points on the axis [µm].
        stiffness: −dF/dx along x, y and z at the equilibrium [pN/µm].
        escape_force: Largest restoring force on the ways out along x, y, and up and down the beam [pN].
        escape_distance: How far from the equilibrium these ways pull back with less than `ESCAPED` of their largest
            force [µm], for good or up to the next well.
        depth: Least work to pull the sphere out along one of these ways [pN·µm].
    """

    equilibrium: float
    others: tuple[float, ...]
    stiffness: tuple[float, float, float]
    escape_force: tuple[float, float, float, float]
    escape_distance: tuple[float, float, float, float]
    depth: float


def axial_equilibria(
    beam: Beam, sphere: Particle, *, reach: float | None = None, device: str | None = None
) -> tuple[float, ...]:
    """Heights of the stable points on the axis above the focus [µm], nearest first: Q_z falls through zero there.

    Args:
        beam, sphere: What pulls at what.
        reach: Search within ±reach [µm]; default 4 µm or twice the radius, whichever is larger.
        device: Where forces are evaluated; see `force`.

    Returns:
        As many as there are, none where light pushes the sphere away.

    Raises:
        InputError: As `force`.
    """
    span = reach or max(4.0, 2.0 * sphere.radius)
    spacing = min(0.05, 0.1 * beam.wavelength)
    checked_points(beam, sphere, np.array([[0.0, 0.0, beam.focus_shift + span]]))
    z = beam.focus_shift + np.arange(-span, span + spacing, spacing)
    q = force(beam, sphere, np.stack([0 * z, 0 * z, z], axis=1), device=device)[:, 2]

    def axial(height: float) -> float:
        return float(force(beam, sphere, np.array([[0.0, 0.0, height]]), device=device)[0, 2])

    falls = np.flatnonzero((q[:-1] > 0.0) & (q[1:] <= 0.0))
    roots: list[Any] = [brentq(axial, z[i], z[i + 1], xtol=1e-10) for i in falls]
    return tuple(sorted(map(float, roots), key=lambda height: abs(height - beam.focus_shift)))


@functools.lru_cache(maxsize=64)
def trap_properties(beam: Beam, sphere: Particle, *, device: str | None = None) -> TrapProperties:
    """Equilibrium [µm], stiffness [pN/µm], escape force [pN] and depth [pN·µm] of a trap, see `TrapProperties`.

    Args:
        beam, sphere: What pulls at what; the results are those at the beam's own power.
        device: Where forces are evaluated; see `force`.

    Raises:
        InputError: The beam does not hold this sphere along its axis, or pushes it out across it.
    """
    along = axial_equilibria(beam, sphere, device=device)
    # a point that pulls back along the axis may push out across it
    slopes = {z: stiffness(beam, sphere, np.array([0.0, 0.0, z]), device=device) for z in along}
    stable = tuple(z for z in along if min(slopes[z]) > 1e-9 * max(slopes[z]))
    if along and not stable:
        raise InputError(
            f"a sphere of radius {sphere.radius:g} µm and index {sphere.index} is stable along the axis of this beam "
            "only and pushed out across it; allowed: an index above the medium's, or a beam without charge"
        )
    if not stable:
        raise InputError(
            f"a sphere of radius {sphere.radius:g} µm and index {sphere.index} has no stable point on the axis of this "
            "beam; allowed: a higher numerical aperture or a lower index contrast"
        )
    point = np.array([0.0, 0.0, stable[0]])
    escapes, ends, works = zip(*(_way_out(beam, sphere, point, np.array(d), device) for d in _WAYS), strict=True)
    return TrapProperties(
        equilibrium=stable[0],
        others=stable[1:],
        stiffness=slopes[stable[0]],
        escape_force=escapes,
        escape_distance=ends,
        depth=min(works),
    )


_WAYS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0))


def stiffness(
    beam: Beam, sphere: Particle, point: np.ndarray, *, device: str | None = None
) -> tuple[float, float, float]:
    """Stiffness −dF_i/dx_i along x, y and z [pN/µm], by Richardson-extrapolated central differences.

    The step is a tenth of the radius and at most `STEP`: the error, of fourth order in the step, stays below 1e-6.

    Args:
        beam, sphere: What pulls at what.
        point: (3,) centre of the sphere from the focus [µm].
        device: Where forces are evaluated; see `force`.

    Raises:
        InputError: As `force`.
    """
    h = min(STEP, 0.1 * sphere.radius)
    offsets = np.array([s * e for e in np.eye(3) for s in (h, -h, 0.5 * h, -0.5 * h)])
    q = force(beam, sphere, point + offsets, device=device).reshape(3, 4, 3)
    out = []
    for axis in range(3):
        coarse = (q[axis, 0, axis] - q[axis, 1, axis]) / (2.0 * h)
        fine = (q[axis, 2, axis] - q[axis, 3, axis]) / h
        out.append(-beam.force_scale * float(4.0 * fine - coarse) / 3.0)
    return out[0], out[1], out[2]


def _way_out(
    beam: Beam, sphere: Particle, start: np.ndarray, direction: np.ndarray, device: str | None
) -> tuple[float, float, float]:
    """Largest restoring force [pN] on a straight way out, where it ends [µm], and the work up to there [pN·µm]."""
    reach = 3.0 * sphere.radius + 4.0 * beam.wavelength
    distance = np.linspace(0.0, reach, 241)
    pull = -beam.force_scale * force(beam, sphere, start + distance[:, None] * direction, device=device) @ direction
    turns = np.flatnonzero((pull[1:-1] > 0.0) & (pull[2:] <= 0.0))
    end = turns[0] + 2 if len(turns) else len(distance)
    inside = pull[:end]
    largest = int(np.argmax(inside))
    weak = np.flatnonzero(inside[largest:] < ESCAPED * inside[largest])
    last = float(distance[largest + weak[0]]) if len(weak) else math.inf
    return float(inside.max()), last, float(np.trapezoid(np.maximum(inside, 0.0), distance[:end]))
