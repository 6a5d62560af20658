"""What is measured of a bead in a trap, with its standard error: variances, correlations, and the mean escape time."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from otwarp.simulation.simulation import Simulation

OBSERVABLES: dict[str, str] = {
    "rho2": "⟨x² + y²⟩",
    "z2": "⟨δz²⟩",
    "x_later": "correlation of x after one relaxation time",
    "z_half_later": "correlation of z after about half of one",
    "z_later": "correlation of z after about one",
    "escape": "mean escape time",
}
"""Observables and what they are."""

PANELS: dict[str, tuple[str, ...]] = {
    "variance": ("rho2", "z2"),
    "correlation": ("x_later", "z_half_later", "z_later"),
    "escape": ("escape",),
}
"""What counts as one: the worst of its observables."""

STATIONARY = (*PANELS["variance"], *PANELS["correlation"])

BURN_IN = 5
"""Relaxation times along the beam before averages begin: what a Gaussian start gets wrong shrinks to e⁻¹⁰ of it."""

FEWEST = 4
"""Windows of averages that any measurement takes."""

FORGOTTEN, WATCHED = 0.5, 1.5
"""Mean escape times after which the start counts as forgotten, and after which watching ends. Escapes then come at a
constant rate: in a well of 5 k_B T the rate at a quarter of the mean is 0.1 % from its limit, at half of it 10⁻⁵."""

SEEN = 2.0
"""Standard errors from zero above which an error counts as seen; below, it is given as a bound."""

WINDOWS = 32
"""Calls of the simulation while escapes are awaited, so that an interrupt is heard."""


@dataclass(frozen=True)
class Mean:
    """A mean and its standard error; nan where nothing was seen."""

    value: float
    error: float


UNSEEN = Mean(np.nan, np.nan)


def from_means(function: Callable[[np.ndarray], np.ndarray], samples: np.ndarray) -> tuple[Mean, ...]:
    """Functions of means over independent worlds, with standard errors to first order (delta method).

    Args:
        function: (k,) means → (m,) values.
        samples: (W, k), one row per world.
    """
    means = samples.mean(axis=0)
    scale = np.maximum(samples.std(axis=0), 1e-300) / np.sqrt(len(samples))
    # the slopes over what the means are uncertain by
    slopes = [(function(means + h) - function(means - h)) / 2.0 for h in np.diag(scale)]
    spread = ((samples - means) / scale) @ np.array(slopes)
    errors = np.sqrt((spread**2).mean(axis=0) / max(len(samples) - 1, 1))
    return tuple(Mean(float(v), float(e)) for v, e in zip(function(means), errors, strict=True))


def measure_stationary(
    sim: Simulation,
    centre: np.ndarray,
    start: np.ndarray,
    *,
    window: int,
    lags: tuple[int, int, int],
    seconds: float,
    note: Callable[[], None] = lambda: None,
) -> dict[str, Mean]:
    """Variances and normalised correlations in a deep trap.

    Args:
        sim: One bead per world.
        centre: (3,) of the trap [µm].
        start: (W, 3) places near the stationary distribution [µm].
        window: Steps between two looks.
        lags: Windows over which x, z and z again are correlated.
        seconds: When to stop [s of wall time].
        note: Called at each look.

    Returns:
        The observables of `STATIONARY`, lengths in µm.
    """
    sim.set_state(position=start[:, None, :])
    for _ in range(BURN_IN * lags[2]):
        note()
        sim.step(window)
    past: list[np.ndarray] = []
    # ρ², z, z², x x', z z', z z'
    sums, counts = np.zeros((sim.model.worlds, 6)), np.zeros(6)
    begin = time.perf_counter()
    while counts.min() < FEWEST or time.perf_counter() - begin < seconds:
        note()
        # transposed copy: on the CPU the array is a view that the next step overwrites
        here = sim.state.position.numpy()[:, 0].T.astype(float) - centre[:, None]
        past = [here, *past][: max(lags) + 1]
        sums[:, 0] += here[0] ** 2 + here[1] ** 2
        sums[:, 1] += here[2]
        sums[:, 2] += here[2] ** 2
        counts[:3] += 1
        for column, lag in enumerate(lags, 3):
            if len(past) > lag:
                then = past[lag]
                sums[:, column] += here[2] * then[2] if column > 3 else here[0] * then[0] + here[1] * then[1]
                counts[column] += 1
        sim.step(window)
    found = from_means(_stationary, sums / counts)
    return dict(zip(STATIONARY, found, strict=True))


def _stationary(m: np.ndarray) -> np.ndarray:
    """Observables from the means of ρ², z, z², x x' + y y' and two of z z'."""
    rho2, z, zz, later, half, whole = m
    z2 = zz - z * z
    return np.array([rho2, z2, later / rho2, (half - z * z) / z2, (whole - z * z) / z2])


def measure_escape(sim: Simulation, mean: float, note: Callable[[], None] = lambda: None) -> Mean:
    """Mean escape time of beads that start where the scene puts them [s].

    They are watched for `WATCHED` of the expected `mean`; see `escape_mean` for those that are still there.
    """
    total = max(WINDOWS, round(WATCHED * mean / sim.time_step))
    for part in np.diff(np.linspace(0, total, WINDOWS + 1).astype(int)).tolist():
        note()
        sim.step(part)
    steps = sim.readout.escape_step.numpy()[:, 0].astype(float)
    # an escape lies anywhere in its step
    times = np.where(steps < 0, np.inf, (steps - 0.5) * sim.time_step)
    return escape_mean(times, FORGOTTEN * mean, total * sim.time_step)


def escape_mean(times: np.ndarray, forgotten: float, end: float) -> Mean:
    """Mean of escape times of which those after `end` are unknown.

    T = ∫₀^f S dt + S(f)/λ, with λ = escapes between f and `end` over the time that beads were there: the estimate of
    greatest likelihood for escapes that come at a constant rate once the start is forgotten, at f.

    Args:
        times: (W,) escape times [s], inf or anything above `end` for those that were not seen.
        forgotten: f [s].
        end: End of watching [s].
    """
    left = times > forgotten
    seen = left & (times <= end)
    if not seen.any():
        return UNSEEN
    there = np.where(left, np.minimum(times, end) - forgotten, 0.0)
    samples = np.stack([np.minimum(times, forgotten), left, there, seen], axis=1).astype(float)
    return from_means(lambda m: np.array([m[0] + m[1] * m[2] / m[3]]), samples)[0]


def bound_of(found: Mean) -> tuple[float, bool]:
    """Size of an error, and whether that is only a bound: `SEEN` standard errors, where it is not seen."""
    seen = abs(found.value) >= SEEN * found.error
    return (abs(found.value), False) if seen else (SEEN * found.error, True)


def worst(errors: dict[str, Mean], panel: str) -> Mean | None:
    """The relative error of a panel: the largest that is seen, or else the one with the widest bound.

    None if one of the panel's observables was not measured.
    """
    found = [errors.get(name) for name in PANELS[panel]]
    known = [e for e in found if e is not None and np.isfinite(e.value)]
    if len(known) < len(found):
        return None
    # False sorts before True: what is seen comes after what is not
    return max(known, key=lambda e: (not bound_of(e)[1], bound_of(e)[0]))
