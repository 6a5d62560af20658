"""Fits of lumicks.pylake to tracks of a file: `python pylake_fit.py TRACKS.npz`, in any environment that has it.

Reads `tracks` (n, samples) [µm], `rate` [1/s], `diameter` [µm], `celsius`, `viscosity` [Pa·s], `low`, `high` [Hz] and
`diode` [Hz], 0 for a perfect detector; prints JSON: versions, and for each track stiffness and its error [pN/µm].
"""

from __future__ import annotations

import json
import sys

import numpy as np


def main() -> None:
    """Command line."""
    import lumicks.pylake as lk
    import scipy

    given = np.load(sys.argv[1])
    diode = float(given["diode"])
    found = []
    for track in given["tracks"]:
        fit = lk.calibrate_force(
            track,
            float(given["diameter"]),
            float(given["celsius"]),
            sample_rate=float(given["rate"]),
            viscosity=float(given["viscosity"]),
            fast_sensor=diode == 0.0,
            fixed_diode=diode or None,
            fixed_alpha=0.0 if diode else None,
            fit_range=(float(given["low"]), float(given["high"])),
            num_points_per_block=int(given["block"]),
        )
        # κ = 2π·γ·f_c with a known drag: its relative error is that of the corner frequency
        error = fit.results["err_fc"].value / fit.results["fc"].value
        stiffness = 1e3 * fit.results["kappa"].value  # pN/nm
        found.append((float(stiffness), float(error * stiffness)))
    versions = {"lumicks.pylake": lk.__version__, "NumPy": np.__version__, "SciPy": scipy.__version__}
    print(json.dumps({"versions": versions, "fits": found}))


if __name__ == "__main__":
    main()
