"""What a run or a study tells: calibrations of traps with intervals, spectra, correlations, work, escapes.

    import otwarp as ot
    bead = ot.analysis.load_trajectory("out/single_bead")
    ot.analysis.calibrate(bead)               # xarray.Dataset: stiffness and drag by estimator and axis

| file | what it holds |
|---|---|
| `trajectory`, `tracks` | recorded runs and arrays as labelled tracks; open `trajectory` first |
| `detector` | a synthetic detector, and what fits allow for |
| `process`, `brownian` | second moments of a trapped bead as a detector samples it; exact tracks |
| `methods`, `estimates` | all calibrations side by side; how their intervals are labelled |
| `stationary` | whether traps rest and the beginning has settled, which they take for granted |
| `spectrum`, `correlation`, `variance`, `likelihood`, `drag` | a calibration each |
| `lifetimes`, `free_energy` | when traps lost what they held; work, Jarzynski and Crooks |
| `curves`, `figure` | what pictures show, and the pictures |

Tracks come in as DataArrays with the dimensions world, time, axis; worlds are repeats of one experiment. Results are
Datasets in which the interval of a quantity stands behind it, under _low and _high.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.analysis.brownian import harmonic_tracks
    from otwarp.analysis.correlation import autocorrelation, fit_autocorrelation, fit_msd, msd
    from otwarp.analysis.curves import fitted_curves
    from otwarp.analysis.detector import Detector
    from otwarp.analysis.drag import drag_calibration
    from otwarp.analysis.figure import draw_analysis
    from otwarp.analysis.free_energy import crooks, jarzynski, work
    from otwarp.analysis.lifetimes import escape_rates, escape_survival, escapes, study_escapes
    from otwarp.analysis.likelihood import forma
    from otwarp.analysis.methods import calibrate
    from otwarp.analysis.spectrum import fit_spectrum, power_spectrum
    from otwarp.analysis.tracks import track
    from otwarp.analysis.trajectory import load_trajectory
    from otwarp.analysis.variance import equipartition

_NAMES = {
    "brownian": ("harmonic_tracks",),
    "correlation": ("autocorrelation", "fit_autocorrelation", "fit_msd", "msd"),
    "curves": ("fitted_curves",),
    "detector": ("Detector",),
    "drag": ("drag_calibration",),
    "figure": ("draw_analysis",),
    "free_energy": ("crooks", "jarzynski", "work"),
    "lifetimes": ("escape_rates", "escape_survival", "escapes", "study_escapes"),
    "likelihood": ("forma",),
    "methods": ("calibrate",),
    "spectrum": ("fit_spectrum", "power_spectrum"),
    "tracks": ("track",),
    "trajectory": ("load_trajectory",),
    "variance": ("equipartition",),
}

__all__ = [
    "Detector",
    "autocorrelation",
    "calibrate",
    "crooks",
    "drag_calibration",
    "draw_analysis",
    "equipartition",
    "escape_rates",
    "escape_survival",
    "escapes",
    "fit_autocorrelation",
    "fit_msd",
    "fit_spectrum",
    "fitted_curves",
    "forma",
    "harmonic_tracks",
    "jarzynski",
    "load_trajectory",
    "msd",
    "power_spectrum",
    "study_escapes",
    "track",
    "work",
]

__getattr__, __dir__ = lazy_names(__name__, _NAMES)
