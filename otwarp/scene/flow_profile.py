"""Profiles of the background flow outside the kernels: its velocity, its bounds, and where it stands still; NumPy.

`PROFILES` has a row for each profile; checks, time steps, walls, periodic axes and packing follow it. What a step does
with a profile stands under the same name in `otwarp.kernels.bodies.flow.FLOW_TERMS`.

Between the plates z = ±h and the walls y = ±b, b ≥ h, of a rectangular channel the velocity is the series

    u = G/2·(h² − z²) − G·16h²/π³ · Σ (−1)^((n−1)/2)/n³ · cosh(nπy/2h)/cosh(nπb/2h) · cos(nπz/2h),  n = 1, 3, 5, …

with G = −(∂p/∂x)/η (F. M. White, Viscous Fluid Flow, 3rd ed. 2006, eq. 3-48; H. Bruus, Theoretical Microfluidics, 2008,
section 3.4.6).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from otwarp.scene.description import Flow
from otwarp.scene.flow_grid import FlowGrid
from otwarp.scene.transforms import rotate

ODD = np.arange(1, 400, 2)

X, Y, Z = range(3)

Planes = tuple[tuple[int, float], ...]
"""(axis, h) for planes at ±h along an axis of the flow's frame [µm]."""


@dataclass(frozen=True)
class Section:
    """Cross section of a flow as the step reads it.

    Attributes:
        half_height, half_width: Along z and y of the step's frame [µm]; 0 where there is none.
        drive: G for a speed of 1 [1/µm²].
        turned: Whether z of the step's frame is along y of the flow's.
    """

    half_height: float = 0.0
    half_width: float = 0.0
    drive: float = 0.0
    turned: bool = False


@dataclass(frozen=True, kw_only=True)
class FlowProfile:
    """A row of `PROFILES`. Points and axes are those of the flow's frame; a strength is |`Flow.<strength>`|.

    Attributes:
        velocity: `(flow, points (n, 3)) → (n, 3)` [µm/s].
        strength: Field of `Flow` to which the velocity is proportional, which is also the parameter `flow_<strength>`;
            None for data.
        fastest: `(flow, strength, extent (3,)) → ` largest velocity where |coordinates| are within `extent` [µm/s].
        gradient: `(flow, strength) → ` largest velocity gradient, or curl of data [rad/s].
        lengths: Fields of `Flow` that must be positive.
        still: Planes on which the liquid is at rest; None for data, at which one has to look.
        across: Axes along which it varies, so that space may not repeat along them; a field that repeats may.
        section: What the step knows of its cross section.
    """

    velocity: Callable[[Flow, np.ndarray], np.ndarray]
    strength: str | None
    fastest: Callable[[Flow, float, np.ndarray], float] = lambda flow, strength, extent: strength
    gradient: Callable[[Flow, float], float]
    lengths: tuple[str, ...] = ()
    still: Callable[[Flow], Planes] | None = lambda flow: ()
    across: tuple[int, ...] = ()
    section: Callable[[Flow], Section] = lambda flow: Section()


def sides(flow: Flow) -> tuple[float, float]:
    """Shorter and longer half side of a rectangular channel [µm]."""
    return min(flow.half_height, flow.half_width), max(flow.half_height, flow.half_width)


def drive(flow: Flow) -> float:
    """G of a rectangular channel for a speed of 1 on its centre line [1/µm²]."""
    h, b = sides(flow)
    signs = (-1.0) ** ((ODD - 1) // 2)
    # 1/cosh without its overflow
    falls = 2.0 * np.exp(-ODD * np.pi * b / (2 * h)) / (1.0 + np.exp(-ODD * np.pi * b / h))
    return 1.0 / (h**2 * (0.5 - 16.0 / np.pi**3 * float((signs / ODD**3 * falls).sum())))


def along_x(speed: np.ndarray) -> np.ndarray:
    """(n, 3) velocities of a flow along x, of speeds (n,)."""
    return speed[:, None] * np.array([1.0, 0.0, 0.0])


def in_plates(flow: Flow, points: np.ndarray) -> np.ndarray:
    """(n, 3) velocity between two plates, U (1 − (z/h)²) [µm/s]; 0 outside."""
    return along_x(flow.speed * np.maximum(0.0, 1.0 - (points[:, Z] / flow.half_height) ** 2))


def in_channel(flow: Flow, points: np.ndarray) -> np.ndarray:
    """(n, 3) velocity in a rectangular channel [µm/s]; 0 outside."""
    h, b = sides(flow)
    across, up = points[:, Y], points[:, Z]
    y, z = (np.abs(across), up) if flow.half_width >= flow.half_height else (np.abs(up), across)
    inside = (y < b) & (np.abs(z) < h)
    y, z = np.minimum(y, b)[:, None], z[:, None]
    signs = (-1.0) ** ((ODD - 1) // 2)
    a = ODD * np.pi / (2 * h)
    ratio = (np.exp(-a * (b - y)) + np.exp(-a * (b + y))) / (1.0 + np.exp(-2.0 * a * b))
    series = (signs / ODD**3 * ratio * np.cos(a * z)).sum(axis=1)
    u = 0.5 * (h**2 - z[:, 0] ** 2) - 16.0 * h**2 / np.pi**3 * series
    return along_x(np.where(inside, flow.speed * drive(flow) * u, 0.0))


def field_of(flow: Flow) -> FlowGrid:
    """The velocity field of a flow that has one."""
    assert flow.field is not None, "scenes are checked"
    return flow.field


PROFILES: dict[str, FlowProfile] = {
    "uniform": FlowProfile(
        velocity=lambda flow, points: along_x(np.full(len(points), flow.speed)),
        strength="speed",
        gradient=lambda flow, speed: 0.0,
    ),
    "shear": FlowProfile(
        velocity=lambda flow, points: along_x(flow.shear_rate * points[:, Z]),
        strength="shear_rate",
        fastest=lambda flow, rate, extent: rate * float(extent[Z]),
        gradient=lambda flow, rate: rate,
        still=lambda flow: ((Z, 0.0),),
        across=(Z,),
    ),
    "poiseuille": FlowProfile(
        velocity=in_plates,
        strength="speed",
        gradient=lambda flow, speed: 2.0 * speed / flow.half_height,
        lengths=("half_height",),
        still=lambda flow: ((Z, flow.half_height),),
        across=(Z,),
        section=lambda flow: Section(flow.half_height),
    ),
    "rectangular": FlowProfile(
        velocity=in_channel,
        strength="speed",
        gradient=lambda flow, speed: speed * drive(flow) * sides(flow)[0],
        lengths=("half_height", "half_width"),
        still=lambda flow: ((Z, flow.half_height), (Y, flow.half_width)),
        across=(Y, Z),
        # z of the step is along the shorter side
        section=lambda flow: Section(*sides(flow), drive(flow), turned=flow.half_height > flow.half_width),
    ),
    "grid": FlowProfile(
        velocity=lambda flow, points: field_of(flow).at(points),
        strength=None,
        fastest=lambda flow, strength, extent: field_of(flow).fastest,
        gradient=lambda flow, strength: float(np.linalg.norm(field_of(flow).curl, axis=-1).max()),
        still=None,
    ),
}
"""Profiles by the names of `Flow.kind`."""


def kinds_with(*, strength: str = "", length: str = "") -> tuple[str, ...]:
    """Names of the profiles of a strength, or with a length."""
    return tuple(name for name, row in PROFILES.items() if row.strength == strength or length in row.lengths)


def flow_velocity(flow: Flow, place: np.ndarray) -> np.ndarray:
    """(n, 3) velocity of a background flow [µm/s] at `place` (n, 3) [µm]; see `Flow`."""
    return rotate(np.array(flow.orientation), PROFILES[flow.kind].velocity(flow, in_frame(flow, place)))


def in_frame(flow: Flow, place: np.ndarray) -> np.ndarray:
    """(n, 3) points [µm] as the flow's frame has them."""
    return rotate(np.array(flow.orientation) * [-1.0, -1.0, -1.0, 1.0], place - flow.origin)
