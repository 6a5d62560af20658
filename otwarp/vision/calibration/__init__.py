"""Calibration of a microscope from its images: pixels, planes and depths in µm, with intervals, as a file.

Images of a grid, of a bead on a stage and of sweeps of the focus come in, rendered here or taken elsewhere; a
`Calibration` goes out. Open `synthetic` first; floor plan, each file importing only from those above it:

    measured                            a number with its interval
    lattice, displacement, planes       a pixel from a grid, or from a stage's steps; heights from sweeps of the focus
    targets                             synthetic ones
    file                                versioned JSON
    synthetic                           all of these together
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.vision.calibration.displacement import pixel_of_steps as pixel_of_steps
    from otwarp.vision.calibration.file import Calibration as Calibration
    from otwarp.vision.calibration.file import load_calibration as load_calibration
    from otwarp.vision.calibration.lattice import pixel_of_grid as pixel_of_grid
    from otwarp.vision.calibration.measured import Measured as Measured
    from otwarp.vision.calibration.planes import depth_scale as depth_scale
    from otwarp.vision.calibration.planes import trap_plane as trap_plane
    from otwarp.vision.calibration.synthetic import calibrate as calibrate
    from otwarp.vision.calibration.targets import Bench as Bench

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "synthetic": ("calibrate",),
        "displacement": ("pixel_of_steps",),
        "file": ("Calibration", "load_calibration"),
        "lattice": ("pixel_of_grid",),
        "measured": ("Measured",),
        "planes": ("depth_scale", "trap_plane"),
        "targets": ("Bench",),
    },
)
