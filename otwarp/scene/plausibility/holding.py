"""Which sphere each trap holds at the start, how far it holds it and how strongly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from otwarp.laws import TrapLaw
from otwarp.scene.description import Trap
from otwarp.scene.scene import Scene
from otwarp.scene.transforms import rotate
from otwarp.units import FORCE_PER_POWER

_RADII, _WAVES = 3.0, 2.0
"""No trap holds a sphere from further than so many radii and wavelengths; computed ones reach half as far."""

_FADE = 1.25
"""An optical force ends where it has faded, so much beyond `Trap.reach`."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Trapped:
    """Spheres that traps act on, at the start.

    Attributes:
        rows: (S, 2) body, and index in the body.
        centres: (S, 3) µm.
        radii: (S,) µm.
    """

    rows: np.ndarray
    centres: np.ndarray
    radii: np.ndarray

    @classmethod
    def of(cls, scene: Scene) -> Trapped:
        """The spheres of all bodies of a scene."""
        rows, centres, radii = [], [], []
        for b, body in enumerate(scene.bodies):
            for i, sphere in enumerate(body.spheres):
                if sphere.trapped:
                    rows.append((b, i))
                    offset = rotate(np.array(body.orientation), np.array(sphere.offset))
                    centres.append(np.array(body.position) + offset)
                    radii.append(sphere.radius)
        shape = np.array(rows, dtype=int).reshape(-1, 2), np.array(centres, dtype=float).reshape(-1, 3)
        return cls(rows=shape[0], centres=shape[1], radii=np.array(radii, dtype=float))


@dataclass(frozen=True, kw_only=True)
class Hold:
    """The sphere that a trap is meant to hold.

    Attributes:
        body, sphere: The body, and the index of the sphere in it.
        radius: Of the sphere [µm].
        gap: Distance of its centre from the trap at the start [µm].
        reach: Distance from which the trap still holds it [µm], inf for a spring without an end.
    """

    body: int
    sphere: int
    radius: float
    gap: float
    reach: float


def anchors(trap: Trap, times: np.ndarray) -> np.ndarray:
    """(n, 3) points where the force of a trap vanishes at `times`, nearly so for optical ones [µm]."""
    foci = trap.position.at_times(times)
    if trap.optical:
        return foci
    return foci + trap.equilibrium * rotate(np.array(trap.orientation), np.array([0.0, 0.0, 1.0]))


def lit(trap: Trap) -> bool:
    """Whether a trap ever has power."""
    return bool(np.any(trap.power.values > 0.0))


def believable_reach(trap: Trap, radius: float) -> float:
    """Distance beyond which no beam holds a sphere of `radius`, whatever the curve says [µm]."""
    return _RADII * radius + _WAVES * trap.wavelength


def reach(trap: Trap, radius: float) -> float:
    """Distance from which a trap still holds a sphere of `radius` [µm], inf for a curve without an end."""
    if trap.optical:
        return min(_FADE * trap.reach, believable_reach(trap, radius))
    return max((law.for_radius(radius).cutoff for law in _laws(trap)), default=math.inf)


def strongest(trap: Trap, radius: float) -> float:
    """The most that a trap can pull a sphere of `radius` with, at its highest power and within its reach [pN]."""
    power = float(trap.power.values.max())
    if trap.optical:  # nothing is pushed with more than the light's own momentum flux in a dense medium
        return 2.0 * FORCE_PER_POWER * power
    end = believable_reach(trap, radius)
    peaks = (_peak(law.for_radius(radius), trap.model, end) * power / law.power for law in _laws(trap))
    return max(peaks, default=0.0)


def _laws(trap: Trap) -> list[TrapLaw]:
    return [law for law in (trap.radial, trap.axial) if law is not None]


def _peak(law: TrapLaw, model: str, end: float) -> float:
    """Largest force of a curve up to its cutoff, or `end` where it has none [pN]."""
    end = min(law.cutoff, end)
    threshold = math.inf if model == "harmonic" else law.threshold
    peaks = [law.stiffness * min(threshold, end)]
    if threshold < end:
        peaks += [law.inverse_square / d / d + law.offset for d in (threshold, end)]  # d² may be 0
    return max(map(abs, peaks))


def holds(scene: Scene, spheres: Trapped) -> list[Hold | None]:
    """Per trap the sphere that it holds: the one it names, else the nearest at the start if that is within reach."""
    named = {s.prim: (b, i) for b, body in enumerate(scene.bodies) for i, s in enumerate(body.spheres)}
    index = {(int(b), int(i)): n for n, (b, i) in enumerate(spheres.rows)}
    found: list[Hold | None] = []
    for trap in scene.traps:
        gaps = np.linalg.norm(spheres.centres - anchors(trap, np.zeros(1)), axis=1)
        n = index.get(named.get(trap.holds, (-1, -1)), -1) if trap.holds else int(gaps.argmin()) if len(gaps) else -1
        if n < 0:
            found.append(None)
            continue
        radius = float(spheres.radii[n])
        b, i = spheres.rows[n].tolist()
        hold = Hold(body=b, sphere=i, radius=radius, gap=float(gaps[n]), reach=reach(trap, radius))
        found.append(hold if trap.holds or hold.gap <= hold.reach else None)
    return found
