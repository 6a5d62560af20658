"""Focused beams as angular spectra of plane waves.

E(r) = ∫ a(s) exp(i k s·r) dΩ with k = 2π n/λ, over directions s = (sin t cos p, sin t sin p, cos t); the focus is at
the origin and the beam travels along +z. A pupil field with Jones vector (Eₓ, E_y) gives, by the rotation of Richards
and Wolf (1959, doi:10.1098/rspa.1959.0200),
a(s) = A(t) exp(iℓp) [(Eₓ cos p + E_y sin p) t̂ + (−Eₓ sin p + E_y cos p) p̂].
The kinds of beam differ in A(t) alone.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.units import FORCE_PER_POWER

JONES: dict[str, tuple[complex, complex]] = {
    "x": (1.0, 0.0),
    "y": (0.0, 1.0),
    "45": (math.sqrt(0.5), math.sqrt(0.5)),
    "circular": (math.sqrt(0.5), 1j * math.sqrt(0.5)),
    "left": (math.sqrt(0.5), -1j * math.sqrt(0.5)),
}
"""Jones vectors by name; `circular` is E = Re[(x̂ + iŷ) exp(i(kz − ωt))]: positive helicity, spin along +z."""

LEAST_APERTURE = 1e-3
"""Numerical aperture of a focus of a third of a millimetre, which traps nothing."""

LEAST_FILLING, MOST_FILLING = 0.01, 100.0
"""Fillings between a beam that uses a hundredth of the aperture and one as good as uniform."""

MOST_CHARGE = 40
"""Azimuthal charge up to which the sums were tested."""

DARK = 6.3
"""√(17 ln 10), rounded up."""

Apodization = Callable[[np.ndarray, float, float], np.ndarray]


def _gaussian(t: np.ndarray, alpha: float, filling: float) -> np.ndarray:
    """A = exp(−tan²t/(f tan α)²) out to π/2: a Gaussian in tan t, no hard edge."""
    return np.exp(-((np.tan(t) / (filling * math.tan(alpha))) ** 2))


def _sine(t: np.ndarray, alpha: float, filling: float) -> np.ndarray:
    """A = exp(−sin²t/(f sin α)²) up to the aperture."""
    return np.exp(-((np.sin(t) / (filling * math.sin(alpha))) ** 2))


def _aplanatic(t: np.ndarray, alpha: float, filling: float) -> np.ndarray:
    """A = √cos t · exp(−sin²t/(f sin α)²) up to the aperture: an objective that obeys the sine condition."""
    return np.sqrt(np.cos(t)) * _sine(t, alpha, filling)


APODIZATIONS: dict[str, tuple[Apodization, bool]] = {
    "gaussian": (_gaussian, False),
    "sine": (_sine, True),
    "aplanatic": (_aplanatic, True),
}
"""A(t) by kind of beam, and whether it ends at the aperture."""


@dataclass(frozen=True, kw_only=True)
class Beam:
    """A focused beam.

    Attributes:
        kind: `gaussian`, `sine` or `aplanatic`.
        numerical_aperture: NA; sin α = NA/medium_index.
        medium_index: Refractive index of the medium.
        wavelength: Vacuum wavelength [µm].
        polarization: Name in `JONES`, or two complex numbers of any length above zero.
        power: In the medium [mW].
        filling: 1/e² intensity radius of the pupil field over the aperture's radius.
        charge: Azimuthal charge ℓ of a vortex beam.
        depth: Nominal depth of the focus below the cover glass [µm]; with `glass_index`, the spherical aberration of
            the glass–medium interface.
        glass_index: Index of glass and immersion oil, or None for no interface.

    Raises:
        InputError: One of them out of range; an aperture that is not below the index of medium and glass.
    """

    kind: str = "gaussian"
    numerical_aperture: float = 1.25
    medium_index: float = 1.33
    wavelength: float = 1.064
    polarization: str | tuple[complex, complex] = "circular"
    power: float = 1.0
    filling: float = 1.0
    charge: int = 0
    depth: float = 0.0
    glass_index: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in APODIZATIONS:
            raise InputError(f"beam kind is {self.kind!r}; allowed: {', '.join(APODIZATIONS)}")
        for name, low in (("medium_index", 1.0), ("wavelength", 0.0), ("filling", 0.0), ("numerical_aperture", 0.0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and (value >= low if name == "medium_index" else value > low)):
                sign = "at least" if name == "medium_index" else "above"
                raise InputError(f"beam {name} is {value:g}; allowed: {sign} {low:g}")
        if not 0.1 <= self.wavelength <= 20.0:
            raise InputError(f"beam wavelength is {self.wavelength:g} µm; allowed: 0.1 to 20")
        if self.numerical_aperture < LEAST_APERTURE:
            raise InputError(
                f"beam numerical_aperture is {self.numerical_aperture:g}; allowed: {LEAST_APERTURE:g} or more"
            )
        if not LEAST_FILLING <= self.filling <= MOST_FILLING:
            raise InputError(f"beam filling is {self.filling:g}; allowed: {LEAST_FILLING:g} to {MOST_FILLING:g}")
        if abs(self.charge) > MOST_CHARGE:
            raise InputError(f"beam charge is {self.charge}; allowed: −{MOST_CHARGE} to {MOST_CHARGE}")
        if self.numerical_aperture >= self.medium_index:
            raise InputError(
                f"numerical aperture is {self.numerical_aperture:g}; allowed: below the medium index "
                f"{self.medium_index:g} (an aperture of {self.numerical_aperture:g} needs an immersion medium of index "
                f"above {self.numerical_aperture:g})"
            )
        if not (math.isfinite(self.power) and self.power >= 0.0):
            raise InputError(f"beam power is {self.power:g} mW; allowed: 0 or more")
        if not (math.isfinite(self.depth) and self.depth >= 0.0):
            raise InputError(f"beam depth is {self.depth:g} µm; allowed: 0 or more")
        if self.depth > 0.0 and self.glass_index is None:
            raise InputError(f"beam depth is {self.depth:g} µm without a glass index; allowed: 0, or with one")
        # light of this aperture could not come through a glass of lower index
        if self.glass_index is not None and not self.numerical_aperture < self.glass_index < math.inf:
            raise InputError(
                f"beam glass_index is {self.glass_index:g}; allowed: above the numerical aperture "
                f"{self.numerical_aperture:g} and finite"
            )
        _ = self.jones

    @property
    def alpha(self) -> float:
        """Half angle of the aperture [rad]."""
        return math.asin(self.numerical_aperture / self.medium_index)

    @property
    def edge(self) -> float:
        """Largest polar angle of the spectrum [rad]."""
        if APODIZATIONS[self.kind][1]:
            return self.alpha
        # beyond, a Gaussian is below 1e-17 of its top
        return math.atan(DARK * self.filling * math.tan(self.alpha))

    @property
    def wavenumber(self) -> float:
        """k = 2π n/λ [rad/µm]."""
        return 2.0 * math.pi * self.medium_index / self.wavelength

    @property
    def aberration(self) -> float:
        """Bound on the phase that the interface adds across the spectrum [rad]: steepest slope times `edge`."""
        if self.glass_index is None or self.depth == 0.0:
            return 0.0
        t = np.linspace(0.0, self.edge, 2001)
        return float(np.abs(np.gradient(self._interface_phase(t), t)).max()) * self.edge

    @property
    def focus_shift(self) -> float:
        """Height of the brightest point on the axis above the nominal focus [µm]: aberration moves it."""
        if self.aberration == 0.0:
            return 0.0
        t, w = np.polynomial.legendre.leggauss(200 + int(self.aberration))
        t, w = 0.5 * self.edge * (t + 1.0), 0.5 * self.edge * w
        # vortices are dark on the axis, but their rings are brightest at the height of the same beam without charge
        weight = w * np.sin(t) * (1.0 + np.cos(t)) * self.amplitude(t)
        z = np.arange(-0.6 * self.depth - 1.0, 0.6 * self.depth + 1.0, 0.1 * self.wavelength)
        field = np.exp(1j * self.wavenumber * z[:, None] * np.cos(t)) @ weight
        return float(z[np.argmax(np.abs(field))])

    def _interface_phase(self, t: np.ndarray) -> np.ndarray:
        # optical path beyond that of the unaberrated focus: Török et al. 1995, doi:10.1364/JOSAA.12.000325
        assert self.glass_index is not None
        ratio = self.medium_index / self.glass_index
        inside = np.sqrt(np.maximum(1.0 - (ratio * np.sin(t)) ** 2, 0.0))
        return self.wavenumber * self.depth * (np.cos(t) - inside / ratio)

    @property
    def jones(self) -> tuple[complex, complex]:
        """Jones vector (Eₓ, E_y) of length 1.

        Raises:
            InputError: No such polarization.
        """
        vector = JONES.get(self.polarization) if isinstance(self.polarization, str) else self.polarization
        if vector is None:
            raise InputError(f"polarization is {self.polarization!r}; allowed: {', '.join(JONES)} or two numbers")
        length = math.sqrt(abs(vector[0]) ** 2 + abs(vector[1]) ** 2)
        if not (math.isfinite(length) and length > 0.0):
            raise InputError(f"polarization is {vector}; allowed: two finite numbers that are not both 0")
        return complex(vector[0]) / length, complex(vector[1]) / length

    @property
    def force_scale(self) -> float:
        """n P/c [pN]: force = force_scale · Q."""
        return FORCE_PER_POWER * self.medium_index * self.power

    def helicities(self) -> tuple[complex, complex]:
        """Amplitudes of positive and negative helicity, E± = (Eₓ ∓ iE_y)/√2."""
        x, y = self.jones
        return (x - 1j * y) / math.sqrt(2.0), (x + 1j * y) / math.sqrt(2.0)

    def amplitude(self, t: np.ndarray) -> np.ndarray:
        """A(t) with the phase of the interface, complex; t in radians, up to `edge`."""
        a = APODIZATIONS[self.kind][0](t, self.alpha, self.filling).astype(complex)
        if self.glass_index is not None and self.depth > 0.0:
            a *= np.exp(1j * self._interface_phase(t))
        return a

    def with_power(self, power: float) -> Beam:
        """The same beam at another power [mW]."""
        return dataclasses.replace(self, power=power)
