"""Curves of a trajectory beside those of the process that fits its spectrum: what pictures show."""

from __future__ import annotations

from typing import Any

import numpy as np

from otwarp.analysis.correlation import autocorrelation, msd, variance_of_mean
from otwarp.analysis.detector import Detector
from otwarp.analysis.estimates import NotTrapped
from otwarp.analysis.process import Process
from otwarp.analysis.spectrum import fitted_process, power_spectrum
from otwarp.analysis.tracks import Tracks, tracks_of

BINS = 40
"""Points of a curve."""

LONGEST = 8.0
"""Longest lag that is shown, in the longest relaxation time."""


def fitted_curves(x: Any, *, detector: Detector | None = None) -> dict[str, Any]:
    """Spectrum, mean squared displacement and autocorrelation of a track, each with the fitted `model`.

    Args:
        x: Track with the dimension `time` [µm].
        detector: What the samples went through; None: a perfect one.

    Returns:
        `psd`, `msd` and `acf`: Datasets as of `power_spectrum`, `msd` and `autocorrelation`.

    Raises:
        InputError: A track that is none or not trapped.
    """
    tracks = tracks_of(x)
    processes = _processes(tracks, detector or Detector())
    _, worlds, n = tracks.values.shape
    full = power_spectrum(x)
    psd = power_spectrum(x, bins=BINS)
    edges = np.geomspace(full["frequency"].values[0] * 0.999, full["frequency"].values[-1] * 1.001, BINS + 1)
    at = np.digitize(full["frequency"].values, edges)
    expected = [np.full(len(at), np.nan) if p is None else p.periodogram(n)[1 : 1 + len(at)] for p in processes]
    psd["model"] = (("axis", "frequency"), [[e[at == b].mean() for b in np.unique(at)] for e in expected])
    longest = LONGEST / min(p.rate for p in processes if p is not None)
    displacement, correlation = msd(x, lags=BINS, longest=longest), autocorrelation(x, lags=BINS, longest=longest)
    rows = []
    for p in processes:
        r = np.full(n, np.nan) if p is None else p.autocovariance(n)
        lags = np.rint(displacement["lag"].values / tracks.interval).astype(int)
        rows.append((2.0 * (r[0] - r[lags]), r[np.append(0, lags)] - variance_of_mean(r, n) / worlds))
    displacement["model"] = (("axis", "lag"), [row[0] for row in rows])
    correlation["model"] = (("axis", "lag"), [row[1] for row in rows])
    return {"psd": psd, "msd": displacement, "acf": correlation}


def _processes(tracks: Tracks, detector: Detector) -> list[Process | None]:
    """By axis, None where the bead is not trapped."""
    found: list[Process | None] = []
    errors = []
    for axis in range(len(tracks.axes)):
        try:
            found.append(fitted_process(tracks, axis, detector))
        except NotTrapped as error:
            found.append(None)
            errors.append(error)
    if len(errors) == len(found):
        raise errors[0]
    return found
