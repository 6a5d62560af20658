"""Whether a trajectory is stationary, which calibrations by fluctuations take for granted: traps at rest, no drift."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

STILL = 1e-3
"""Traps whose positions differ by less are at rest [µm]."""

STEADY = 1e-3
"""Powers that differ by a smaller share of the largest are the same."""

PARTS = (20, 80, 320)
"""In how many blocks a track is divided: settling that is short is not seen in long ones."""

SIGMAS = 5.0
"""Deviation of the first block's mean that counts, of a normal distribution."""


def not_stationary(trajectory: Any) -> list[str]:
    """What speaks against a calibration by fluctuations, a sentence each; none for a trajectory that is stationary.

    Args:
        trajectory: Dataset with `displacement`, as of `load_trajectory`; where it has `foci` or `trap_position`, and
            `trap_power`, motion of the traps is found. The beginning is judged only where traps rest.
    """
    axes = [str(a) for a in np.atleast_1d(trajectory["axis"].values)] if "axis" in trajectory.coords else ["x"]
    found = _moving(trajectory, axes)
    return found or [said for said in [_settling(trajectory["displacement"], axes)] if said]


def _moving(trajectory: Any, axes: list[str]) -> list[str]:
    """What its traps do."""
    out = []
    name = next((name for name in ("foci", "trap_position") if name in trajectory), None)
    if name is not None:
        way = trajectory[name].max("time") - trajectory[name].min("time")
        way = way.max([d for d in way.dims if d not in ("axis", "xyz")]).values
        moved = [
            f"{w:.3g} µm along {a}" for w, a in zip(way, "xyz" if name == "foci" else axes, strict=True) if w > STILL
        ]
        if moved:
            out.append(
                f"the trap moves within the analysed time, by {', '.join(moved)}, for which calibrations by "
                "fluctuations do not allow; allowed: a time at which it rests (--from, --until), or --drag, --work"
            )
    if "trap_power" in trajectory:
        power = trajectory["trap_power"]
        if float((power.max("time") - power.min("time")).max()) > STEADY * float(np.abs(power).max()):
            out.append(
                "the power of the trap changes within the analysed time, for which calibrations by fluctuations do "
                "not allow; allowed: a time at which it stays (--from, --until)"
            )
    return out


def _settling(displacement: Any, axes: list[str]) -> str | None:
    """How far the beginning is from the rest of the track, and where the rest begins."""
    x = displacement if "world" in displacement.dims else displacement.expand_dims("world")
    x = x if "axis" in x.dims else x.expand_dims("axis")
    values = x.transpose("axis", "world", "time").values.astype(float)
    time, unit = np.asarray(displacement["time"].values, dtype=float), displacement.attrs.get("units", "um")
    worst: tuple[float, int, str] | None = None
    for track, axis in zip(values, axes, strict=True):
        for parts in PARTS:
            length = track.shape[1] // parts
            if length < 1 or not np.all(np.isfinite(track)):
                continue
            means = track[:, : length * parts].reshape(len(track), parts, length).mean(axis=2)
            settled = next((k for k in range(parts // 2) if not _differs(means[:, k:])), parts // 2)
            if settled and (worst is None or settled * length > worst[1]):
                worst = (abs(float(means[:, 0].mean() - means[:, settled:].mean())), settled * length, axis)
    if worst is None:
        return None
    by, samples, axis = worst
    step = 10.0 ** (math.floor(math.log10(max(time[samples] - time[0], 1e-12))) - 1)
    after = math.ceil(time[samples] / step - 1e-9) * step
    return (
        f"the beginning has not settled: its mean is {by:.3g} {unit.replace('um', 'µm')} off along {axis}, more than "
        f"{SIGMAS:g} standard errors; leave it out with --from {after:.6g}"
    )


def _differs(means: np.ndarray) -> bool:
    """Whether the first of (worlds, blocks) means of blocks is further from the rest than chance has it.

    The spread of the rest is that of single blocks, which holds however correlated neighbours are.
    """
    from scipy.special import ndtr, stdtrit

    rest = means[:, 1:]
    freedom = rest.size - 1
    error = float(rest.std(ddof=1)) * math.sqrt(1.0 / len(means) + 1.0 / rest.size)
    return abs(float(means[:, 0].mean() - rest.mean())) > -float(stdtrit(freedom, ndtr(-SIGMAS))) * error
