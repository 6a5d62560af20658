"""How much harder a sphere moves near a no-slip plane: short formulae that kernels and float64 code share.

Every quantity is the excess over the free sphere, a ratio of polynomials in the gap g = h/a − 1, fitted to the exact
solution (`otwarp.hydrodynamics.bispherical`) between 10⁻³ and 10³ radii, with its leading term far from the wall fixed.
Near the wall they run into lubrication theory, ln g along the wall down to `GAP_FLOOR` and 1/g for the approach down to
`CONTACT_GAP`. Below they stay where they are: surfaces are not smooth on that scale, and a resistance that grew without
bound would freeze a sphere that touches. `FIT_ERROR` is what the fits leave.

Rational fits of hindered mobilities go back to M. A. Bevan, D. C. Prieve, J. Chem. Phys. 113, 1228 (2000),
doi:10.1063/1.481900.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

GAP_FLOOR = 1e-3
"""Gap over radius below which the resistances to motion along the wall and to rotation no longer grow."""

CONTACT_GAP = 1e-4
"""Gap over radius below which the resistance to approach no longer grows.

Ten times lower, because time steps must not see it: where the mobility bends within one step the distribution next to
the wall is wrong, by 12 % within 0.01 radii for a floor of 10⁻³ at the step that otwarp chooses, by 5 % for this one.
"""

GAP_FAR = 1e4
"""Gap over radius beyond which the excess stays at its (negligible) value there: polynomials would overflow float32."""

FIT_ERROR = 1.1e-3
"""Largest error of the fits, relative to the resistance they belong to (coupling: to √(parallel·roll))."""

Coefficients = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class GapFit:
    """Excess E(g) = N(g)/D(g), or N(g)/(g·D(g)) with `pole`; coefficients in rising powers of g."""

    numerator: Coefficients
    denominator: Coefficients
    pole: bool = False

    @property
    def floor(self) -> float:
        """Gap below which the value stays."""
        return CONTACT_GAP if self.pole else GAP_FLOOR

    def polynomials(self) -> tuple[Coefficients, Coefficients]:
        """Numerator and denominator with the pole multiplied in."""
        return self.numerator, ((0.0, *self.denominator) if self.pole else self.denominator)

    def __call__(self, gap: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """(E, dE/dg) at `gap` = h/a − 1; constant, with slope 0, below `floor` and beyond `GAP_FAR`."""
        g = np.asarray(gap, dtype=float)
        inside = (g > self.floor) & (g < GAP_FAR)
        clamped = np.clip(g, self.floor, GAP_FAR)
        top, bottom = (np.polynomial.Polynomial(c) for c in self.polynomials())
        value = top(clamped) / bottom(clamped)
        slope = (top.deriv()(clamped) - value * bottom.deriv()(clamped)) / bottom(clamped)
        return value, np.where(inside, slope, 0.0)


NORMAL = GapFit(
    numerator=(0.057857796, 1.8773638, 4.8745487, 1.125),
    denominator=(0.057827001, 1.8196665, 4.1732743, 1.0),
    pole=True,
)
"""Motion along the normal, over 6πηa; far away (9/8)a/h."""

SLIDING = GapFit(
    numerator=(3.9710553e-07, 9.570854e-04, 0.094440517, 0.5625),
    denominator=(7.288196e-08, 2.8851161e-04, 0.047696678, 0.66979303, 1.0),
)
"""Motion along the wall of a sphere free to rotate, over 6πηa; far away (9/16)a/h."""

PARALLEL = GapFit(
    numerator=(3.8715332e-07, 9.4742367e-04, 0.094025069, 0.5625),
    denominator=(6.7861653e-08, 2.7710921e-04, 0.046700693, 0.66960792, 1.0),
)
"""Motion along the wall without rotation, over 6πηa; far away (9/16)a/h."""

ROLL = GapFit(
    numerator=(2.405881e-05, 0.012217738, 0.3125),
    denominator=(8.6122442e-06, 0.0080031185, 0.50830185, 3.4074425, 2.8491941, 1.0),
)
"""Rotation about an axis along the wall, over 8πηa³; far away (5/16)(a/h)³."""

SPIN = GapFit(
    numerator=(0.0042544426, 0.125),
    denominator=(0.021181339, 0.84938931, 3.3713471, 2.9246462, 1.0),
)
"""Rotation about the normal, over 8πηa³; far away (1/8)(a/h)³."""

COUPLING = GapFit(
    numerator=(6.9539324e-06, 0.0039818334, 0.125),
    denominator=(7.7526716e-06, 0.0082244738, 0.64675983, 5.9023989, 7.182754, 4.4892858, 1.0),
)
"""Between motion along the wall and rotation, over 6πηa² (whole, as the free sphere has none); far away (1/8)(a/h)⁴."""

SHEAR_FORCE = GapFit(numerator=(1.5732062, 0.5625), denominator=(2.2459509, 3.1981506, 1.0))
"""Force on a fixed sphere in a flow that grows from zero at the wall, over 6πηa·u(h); far away (9/16)a/h."""

SHEAR_TORQUE = GapFit(numerator=(0.1875,), denominator=(3.3290215, 5.3224358, 3.2773584, 1.0))
"""What the torque of that flow lacks, over 8πηa³·ω with ω half the shear rate; far away (3/16)(a/h)³."""

ENTRAINED = GapFit(
    numerator=(8.1987756e-04, 0.20831987, 2.0126203, 0.5625),
    denominator=(0.0010152007, 0.26999057, 3.135703, 3.9538683, 1.0),
)
"""Excess of the force that carries a sphere free to rotate along in that flow, over 6πηa·u(h): it moves with
u(h)·(1 + this)/(1 + `SLIDING`)."""
