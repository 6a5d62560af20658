"""Force tables: how nested (ρ, z) grids are laid out and addressed, for a float or an array of them alike.

In the beam's cylindrical coordinates a force table is a ladder of levels, each a grid of nodes about the focus. Node
[j, i] of a level of radius R and spacing h is at ρ = (i − 1)·h, z = (j − 1)·h − R: one more than the disc needs on each
side. It holds 1, 2 or 3 layers of (F_ρ, F_φ, F_z), which the azimuth combines, exactly (`layer_factors`), as values for
`bilinear` interpolation or as coefficients of B-splines for `bicubic`. A level serves up to its `end`. Over the outer
fifth, from `BLEND`·end on, it passes into the next one, or the last into zero, by x²(3 − 2x) in the squared distance.

These functions are those of `otwarp.optics.ForceTable` (NumPy, the reference). `otwarp.kernels.optics.force_table`
(Warp), `otwarp.haptics.force.law` (plain floats, Warp's bits) and `otwarp.kernels.cpu.table_block` (a CPU's vectors)
say the same in their languages; `tests/laws/test_table.py` compares all four.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeVar

if TYPE_CHECKING:
    import numpy as np

Real = TypeVar("Real", float, "np.ndarray")
"""A number, or an array of numbers."""

Interpolation = Literal["bilinear", "bicubic"]

BLEND = 0.8
"""Fraction of a level's radius beyond which it passes into the next one, or the last into zero."""


def coordinates(rho: Real, z: Real, spacing: float, radius: float) -> tuple[Real, Real]:
    """Column and row of a place [µm] in a level, counted in nodes: the whole parts are those of its cell."""
    return rho / spacing + 1.0, (z + radius) / spacing + 1.0


def linear_weights(t: Real) -> tuple[Real, Real]:
    """Weights of the nodes 0 and 1 at offset t in a cell, linear."""
    return 1.0 - t, t


def cubic_weights(t: Real) -> tuple[Real, Real, Real, Real]:
    """Weights of the nodes −1, 0, 1, 2 at offset t in a cell: the uniform cubic B-spline."""
    s = 1.0 - t
    return (
        s**3 / 6.0,
        (4.0 - 6.0 * t**2 + 3.0 * t**3) / 6.0,
        (4.0 - 6.0 * s**2 + 3.0 * s**3) / 6.0,
        t**3 / 6.0,
    )


STENCILS = {"bilinear": (0, linear_weights), "bicubic": (-1, cubic_weights)}
"""First node of a cell's stencil along either axis, and its weights, by interpolation."""


def layer_factors(cosine: Real, sine: Real) -> tuple[tuple[Real, Real, Real], tuple[Real, Real, Real]]:
    """Factors of (F_ρ, F_φ, F_z) in the second and the third layer at an azimuth: cos 2φ and sin 2φ."""
    c2, s2 = cosine * cosine - sine * sine, 2.0 * cosine * sine
    return (c2, s2, c2), (s2, c2, s2)
