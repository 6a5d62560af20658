"""What depends on how finely float64 rounds: as `otwarp.kernels.core.rounding`."""

import warp as wp

SMALL_ANGLE2 = wp.constant(1.0e-4)
"""The series end with terms below θ⁶/46080 ≤ 3e-17."""
