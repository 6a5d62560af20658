"""What depends on how finely float64 rounds: as `otwarp.kernels.core.rounding`."""

import warp as wp

SMALL_ANGLE2 = wp.constant(1.0e-4)
"""The series end with terms below θ⁶/46080 ≤ 3e-17."""

PI = wp.constant(3.141592653589793)
"""π, as a constant of kernels."""

PRECISION = "float64"
"""Precision of the modules that import this one."""
