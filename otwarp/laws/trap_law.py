"""The force curve of an optical trap: a spring, or the two-branch law of the paper (eq. 1)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

PER_POWER = ("stiffness", "inverse_square", "offset")
"""Constants of a law that are in proportion to the power."""

MODELS = ("harmonic", "piecewise")
"""Models of traps (`ot:trap:model`) whose curve is a `TrapLaw`, as `TrapLaw.ratio` has it."""

FIELDS = ("stiffness", "threshold", "inverse_square", "offset", "cutoff")
"""Constants of a law, by which kernels and parameters name them; those along the beam have the prefix `axial_`."""


@dataclass(frozen=True, kw_only=True)
class TrapLaw:
    """One force curve F(d) of a trap (the paper's eq. 1), restoring towards the trap.

    F(d) = stiffness·d for d < threshold, inverse_square/d² + offset from there to the cutoff, 0 beyond the cutoff.
    A harmonic law uses `stiffness` and `cutoff` alone. F holds at `power` and scales in proportion to the trap's.
    With `radius` > 0 the law was fitted for a sphere of that radius, and another radius r feels F(d·radius/r): the
    similarity of ray optics, where the force depends on d/r alone.

    Attributes:
        stiffness: K, pN/µm.
        threshold: δ, µm.
        inverse_square: A, pN·µm².
        offset: C, pN.
        cutoff: D, µm (may be inf).
        power: mW.
        radius: µm, 0 to leave distances unscaled.
    """

    stiffness: float
    threshold: float = math.inf
    inverse_square: float = 0.0
    offset: float = 0.0
    cutoff: float = math.inf
    power: float = 20.0
    radius: float = 0.0

    def per_mw(self) -> TrapLaw:
        """The law at 1 mW, as kernels and servo hold it."""
        return replace(self, **{name: getattr(self, name) / self.power for name in PER_POWER}, power=1.0)

    def for_radius(self, radius: float) -> TrapLaw:
        """The law as a sphere of `radius` [µm] feels it; its distances are then unscaled.

        As `otwarp.kernels.optics.trap_laws.prepare_law`: F(s·d), s = fitted radius/`radius`.
        """
        if self.radius == 0.0:
            return self
        s = self.radius / radius
        return replace(
            self,
            stiffness=self.stiffness * s,
            threshold=self.threshold / s,
            inverse_square=self.inverse_square / (s * s),
            cutoff=self.cutoff / s,
            radius=0.0,
        )

    def ratio(self, distance2: float) -> float:
        """F(d)/d at the squared distance `distance2` [µm²] in pN/µm; 0 at d = 0 for a law without a linear branch."""
        # written so that a NaN is within reach, and is seen in the sum
        if distance2 >= self.cutoff * self.cutoff:
            return 0.0
        if distance2 < self.threshold * self.threshold:
            return self.stiffness
        if not distance2:
            return 0.0
        # as `otwarp.kernels.optics.trap_laws.piecewise_ratio`, bit for bit
        per_distance = 1.0 / math.sqrt(distance2)
        return (self.inverse_square * per_distance * per_distance + self.offset) * per_distance
