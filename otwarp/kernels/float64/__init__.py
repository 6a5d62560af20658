"""The kernels in float64: made from those of `otwarp.kernels` on import, see `otwarp.kernels.core.precision`.

The files here are what cannot be made: native code of one precision, and the border to the float32 random numbers.
"""

from __future__ import annotations

import sys

from otwarp.kernels.core.precision import DoubleModules

if not any(isinstance(finder, DoubleModules) for finder in sys.meta_path):
    # last, so that the files of this package come first
    sys.meta_path.append(DoubleModules())
