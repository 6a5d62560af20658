"""`Detector`: what lies between a bead and the numbers of its track; applied to a track, and allowed for in fits.

Light is gathered over an exposure, slowed by an anti-alias filter or the diode, sampled, and comes with noise and
drift. One object says so for both directions: `see` makes of a finely sampled track what a detector would have
recorded, and every fit that takes a detector expects just that (`otwarp.analysis.process`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from otwarp.analysis.tracks import labelled, tracks_of
from otwarp.errors import InputError

FINER = 4
"""Samples of a track that an exposure must span to be averaged over."""

SLOWER = 10.0
"""By how much a track is sampled faster than the corner of the filter that it is to pass."""


@dataclass(frozen=True, kw_only=True)
class Detector:
    """A position detector; the default one is perfect.

    Attributes:
        rate: Samples per second [1/s]; 0 for those of the track.
        exposure: Time over which each sample averages [s], up to one interval between samples.
        noise: Standard deviation of white noise of each sample [µm].
        drift: Along each axis [µm/s].
        cutoff: −3 dB frequency of a Butterworth low-pass filter before the samples are taken [Hz]; inf for none.
        order: Of the filter; 1 also describes a photodiode.
        passed: Share α of the signal that is not slowed: H = α + (1 − α)/(1 + i·f/cutoff) for order 1, as of a
            photodiode in infrared light (Berg-Sørensen et al. 2003, doi:10.1063/1.1554755).

    Raises:
        InputError: A value that no detector has.
    """

    rate: float = 0.0
    exposure: float = 0.0
    noise: float = 0.0
    drift: float = 0.0
    cutoff: float = math.inf
    order: int = 1
    passed: float = 0.0

    def __post_init__(self) -> None:
        for name, good, allowed in (
            ("rate", 0.0 <= self.rate < math.inf, "0 or more, in 1/s"),
            ("exposure", 0.0 <= self.exposure < math.inf, "0 or more, in s"),
            ("noise", 0.0 <= self.noise < math.inf, "0 or more, in µm"),
            ("drift", math.isfinite(self.drift), "finite, in µm/s"),
            ("cutoff", self.cutoff > 0.0, "above 0, in Hz"),
            ("order", self.order in range(1, 9), "a whole number, 1 to 8"),
            ("passed", 0.0 <= self.passed < 1.0, "0 to below 1"),
        ):
            if not good:
                raise InputError(f"detector: {name} = {getattr(self, name)}; allowed: {allowed}")

    @classmethod
    def parse(cls, text: str) -> Detector:
        """The detector that a `text` such as `rate=500,exposure=0.001,noise=0.005` describes, in 1/s, s and µm.

        Raises:
            InputError: A name that it does not have, or a value that is no number.
        """
        names = [f.name for f in fields(cls)]
        values: dict[str, Any] = {}
        for part in text.split(","):
            name, equals, value = part.partition("=")
            if name.strip() not in names or not equals:
                raise InputError(f"detector: {part.strip()!r}; allowed: NAME=VALUE of {', '.join(names)}")
            try:
                values[name.strip()] = int(value) if name.strip() == "order" else float(value)
            except ValueError:
                raise InputError(f"detector: {name.strip()} = {value!r}; allowed: a number") from None
        return cls(**values)

    def check(self, interval: float) -> None:
        """Refuse an exposure that outlasts the interval between samples [s].

        Raises:
            InputError: It does.
        """
        if self.exposure > interval * (1.0 + 1e-6):
            raise InputError(f"detector: exposure = {self.exposure:g} s; allowed: up to the interval, {interval:.6g} s")

    def see(self, track: Any, *, seed: int = 0) -> Any:
        """What this detector records of a track, with the same labels.

        The filter is that of the track's own sampling (bilinear) and begins at rest: what it needs to forget that is
        left out. A sample at t averages from t − exposure to t, by the trapezoidal rule.

        Args:
            track: DataArray with a dimension `time`, sampled finely: `FINER` times in an exposure, `SLOWER` times
                faster than the filter's corner.
            seed: Of the noise.

        Raises:
            InputError: The track is sampled too coarsely for that, or is too short.
        """
        tracks = tracks_of(track, least=2)
        fine, values = tracks.interval, tracks.values
        stride = self._stride(fine)
        self._check_track(fine, stride * fine)
        if math.isfinite(self.cutoff):
            values = self._filtered(values, fine)
        forget = 10.0 / self.cutoff if math.isfinite(self.cutoff) else 0.0
        first = math.ceil(max(forget, self.exposure) / fine - 1e-6)
        at = np.arange(first, values.shape[-1], stride)
        if len(at) < 2:
            least = (first + stride) * fine
            raise InputError(
                f"detector: the track lasts {values.shape[-1] * fine:.3g} s; allowed: {least:.3g} s or more"
            )
        seen = _averaged(values, at, self.exposure / fine) if self.exposure else values[..., at]
        random = np.random.Generator(np.random.Philox(seed))
        seen = seen + self.noise * random.standard_normal(seen.shape) + self.drift * fine * (at - first)
        return labelled(seen, stride * fine, tracks, start=tracks.start + first * fine)

    def _stride(self, fine: float) -> int:
        """Samples of the track from one of the detector to the next."""
        if not self.rate:
            return 1
        stride = 1.0 / (self.rate * fine)
        near = max(1, round(stride))
        if abs(stride - near) > 1e-3 * near:
            raise InputError(
                f"detector: rate = {self.rate:g} 1/s; allowed: the track's {1.0 / fine:.6g} 1/s over a whole number, "
                f"such as {1.0 / (near * fine):.6g}"
            )
        return near

    def _check_track(self, fine: float, interval: float) -> None:
        self.check(interval)
        if self.exposure and self.exposure < FINER * fine * (1.0 - 1e-6):
            raise InputError(
                f"detector: exposure = {self.exposure:g} s; allowed with samples of {fine:.3g} s: 0, or "
                f"{FINER * fine:.3g} s and more"
            )
        if self.cutoff < math.inf and self.cutoff * SLOWER > 1.0 / fine:
            raise InputError(
                f"detector: cutoff = {self.cutoff:g} Hz; allowed with samples of {fine:.3g} s: up to "
                f"{1.0 / (SLOWER * fine):.4g} Hz"
            )

    def _filtered(self, values: np.ndarray, fine: float) -> np.ndarray:
        from scipy.signal import butter, sosfilt

        sections: Any = butter(self.order, self.cutoff, fs=1.0 / fine, output="sos")
        begin = values[..., :1]
        slow = np.asarray(sosfilt(sections, values - begin, axis=-1)) + begin
        return self.passed * values + (1.0 - self.passed) * slow


def _averaged(values: np.ndarray, at: np.ndarray, samples: float) -> np.ndarray:
    """Averages over so many intervals between samples before each of `at`, of straight lines between samples."""
    area = np.zeros_like(values)
    area[..., 1:] = np.cumsum(0.5 * (values[..., 1:] + values[..., :-1]), axis=-1)
    begin = np.maximum(at - samples, 0.0)
    left = np.minimum(begin.astype(int), values.shape[-1] - 2)
    share = begin - left
    rise = values[..., left] * share + 0.5 * (values[..., left + 1] - values[..., left]) * share**2
    return (area[..., at] - area[..., left] - rise) / samples
