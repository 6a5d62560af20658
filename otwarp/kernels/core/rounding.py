"""What depends on how finely numbers round, here float32."""

import warp as wp

SMALL_ANGLE2 = wp.constant(0.09)
"""Squared rotation [rad²] up to which the series of `rotation` give sine and cosine to rounding: 2e-8 here."""

PI = wp.constant(3.141592653589793)
"""π, as a constant of kernels."""

PRECISION = "float32"
"""Precision of the modules that import this one."""
