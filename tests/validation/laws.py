"""How a run is held against a law: five standard errors, and the statistics that standard errors come from."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

SIGMAS = 5.0
"""A comparison fails beyond five standard errors: by chance once in 1.7 million Gaussian comparisons."""

CHANCE = 2.0 * stats.norm.sf(SIGMAS)
"""The probability that goes with it, for statistics that are not Gaussian."""


@dataclass(frozen=True)
class Law:
    """Compares a measurement with a law, asserts, and notes the figures for docs/validation and `pytest -rP`."""

    record: Callable[[str, object], None]

    def __call__(
        self,
        quantity: str,
        measured: ArrayLike,
        expected: ArrayLike,
        error: ArrayLike,
        *,
        bias: float | ArrayLike = 0.0,
    ) -> None:
        """Assert |measured − expected| ≤ 5·error + bias, element by element.

        Args:
            quantity: What it is, with its unit.
            measured, expected, error: Of one shape, or such that they broadcast; `error` is the standard error.
            bias: Known bound of a systematic difference (time step, anharmonicity, float32), in the same unit.
        """
        m, e, s, b = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (measured, expected, error, bias)))
        assert np.all(np.isfinite(m)) and np.all(s > 0.0), quantity
        excess = np.maximum(np.abs(m - e) - b, 0.0) / s
        # the element that comes nearest to failing stands for all
        w = np.unravel_index(int(np.argmax(excess + 1e-6 * np.abs(m - e) / s)), m.shape)
        row = {
            "quantity": quantity,
            "count": int(m.size),
            "measured": float(m[w]),
            "expected": float(e[w]),
            "error": float(s[w]),
            "bias": float(b[w]),
            "sigmas": float((m[w] - e[w]) / s[w]),
        }
        self.record("law", json.dumps(row))
        print(
            f"{quantity}: measured {row['measured']:.6g}, law {row['expected']:.6g}, standard error {row['error']:.2g}"
            f", bias up to {row['bias']:.2g}: {row['sigmas']:+.2f} sigma, worst of {row['count']}"
        )
        assert excess.max() <= SIGMAS, f"{quantity}: {excess.max():.2f} standard errors beyond the bias"

    def tensor(
        self, quantity: str, measured: np.ndarray, expected: ArrayLike, error: ArrayLike, *, bias: float = 0.0
    ) -> None:
        """The same for a square matrix, diagonal and remainder apart: zeros would hide what matters in the table."""
        m, e, s = np.broadcast_arrays(measured, expected, error)
        own = np.eye(len(m), dtype=bool)
        self(f"{quantity}, i = j", m[own], e[own], s[own], bias=bias)
        self(f"{quantity}, i ≠ j", m[~own], e[~own], s[~own], bias=bias)

    def chi_square(self, quantity: str, counts: ArrayLike, probability: ArrayLike) -> None:
        """Assert that counts of independent samples follow the given probabilities (Pearson's χ², all bins filled)."""
        n, p = np.asarray(counts, dtype=float), np.asarray(probability, dtype=float)
        assert abs(p.sum() - 1.0) < 1e-6, f"{quantity}: probabilities sum to {p.sum()}"
        mean = n.sum() * p
        assert mean.min() >= 10.0, f"{quantity}: a bin of {mean.min():.1f} expected counts is too small for χ²"
        degrees = n.size - 1
        found = float(((n - mean) ** 2 / mean).sum())
        chance = float(stats.chi2.sf(found, degrees))
        row = {
            "quantity": f"χ² of {quantity}, {degrees} degrees of freedom",
            "count": 1,
            "measured": found,
            "expected": float(degrees),
            "error": float(np.sqrt(2.0 * degrees)),
            "bias": 0.0,
            "sigmas": (found - degrees) / np.sqrt(2.0 * degrees),
        }
        self.record("law", json.dumps(row))
        print(f"{row['quantity']}: {found:.1f}, probability {chance:.3g}")
        assert chance > CHANCE, f"{quantity}: χ² = {found:.1f} on {degrees} degrees of freedom"


def across_worlds(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard error from (W, …) values of independent worlds."""
    return values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))


def lagged(a: np.ndarray, b: np.ndarray, lag: int) -> np.ndarray:
    """(W, i, j) per-world mean of a_i(t) b_j(t + lag) from (samples, W, i) and (samples, W, j)."""
    late, early = b[lag:], a[: len(a) - lag]
    return np.einsum("twi,twj->wij", early, late) / len(early)
