"""What a hand feels of a scene: the force laws of its traps, and the trapped spheres near them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from otwarp.haptics.core.types import SceneFrame, SphereFrame, TrapFrame, Vec3
from otwarp.haptics.force.law import IsotropicLaw, Law, SplitLaw
from otwarp.haptics.force.table import TableLaw
from otwarp.scene import description
from otwarp.scene.transforms import rotate
from otwarp.simulation.frame import Frame
from otwarp.simulation.model import Model

SLOTS = 16
"""Spheres of one optical kind that a servo period evaluates at most; the nearest to the hands' traps. The force on one
in reach costs about 1 µs for each trap, so 16 leave a 1 kHz period room."""


def authored_law(trap: description.Trap, radius: float) -> Law:
    """A trap's authored law as a sphere of `radius` [µm] feels it."""
    assert trap.radial is not None, "optical traps have tables"
    axis = _vector(rotate(np.array(trap.orientation), np.array([0.0, 0.0, 1.0])))
    laws = [law.per_mw().for_radius(radius) for law in (trap.radial, trap.axial) if law is not None]
    # a spring ends where its linear branch does
    curves = [replace(law, threshold=min(law.threshold, law.cutoff)) for law in laws]
    if len(curves) == 1:
        return IsotropicLaw(curves[0], axis, trap.equilibrium)
    return SplitLaw(curves[0], curves[1], axis, trap.equilibrium)


def optical_law(model: Model, trap: int, kind: int) -> Law:
    """A trap's tabulated law for one kind of sphere."""
    table, turn = model.optics.bilinear(model.scene, trap, kind, model.device.alias)
    frame = np.array([[math.cos(turn), math.sin(turn), 0.0], [0.0, 0.0, 1.0]])
    side, axis = rotate(np.array(model.scene.traps[trap].orientation), frame)
    return TableLaw.of(table, side=_vector(side), axis=_vector(axis))


@dataclass(frozen=True, eq=False)
class LocalScene:
    """The trapped spheres of a scene, and who pulls on them how.

    Attributes:
        laws: For each trap, its law for each kind of sphere.
        kinds: Kind of each slot of `SceneFrame.spheres`.
    """

    laws: dict[int, tuple[Law, ...]]
    kinds: tuple[int, ...]
    _body: np.ndarray
    _offset: np.ndarray
    _kind: np.ndarray
    _hands: np.ndarray
    _chosen: np.ndarray = field(repr=False)

    @classmethod
    def of(cls, model: Model, hands: Sequence[int], *, slots: int = SLOTS) -> LocalScene:
        """From a built model.

        Args:
            hands: Indices of the traps that hands move; the spheres nearest to them fill the slots.
            slots: Most spheres of one kind.
        """
        scene, optics = model.scene, model.optics
        spheres = [(b, s) for b, body in enumerate(scene.bodies) for s in body.spheres if s.trapped]
        kinds = np.array([optics.kind(s.radius, s.refractive_index) for _, s in spheres], dtype=int)
        laws = {
            t: tuple(
                optical_law(model, t, k) if trap.optical else authored_law(trap, radius)
                for k, (radius, _) in enumerate(optics.kinds)
            )
            for t, trap in enumerate(scene.traps)
            if t in set(hands)
        }
        chosen = np.concatenate(
            [np.zeros(0, dtype=int), *(np.flatnonzero(kinds == k)[:slots] for k in range(len(optics.kinds)))]
        )
        return cls(
            laws if spheres else {},
            tuple(int(k) for k in kinds[chosen]),
            np.array([b for b, _ in spheres], dtype=int),
            np.array([s.offset for _, s in spheres]).reshape(-1, 3),
            kinds,
            np.array(sorted(set(hands)), dtype=int),
            chosen,
        )

    def now(self, beat: int, frame: Frame) -> SceneFrame:
        """A state as the servo takes it; the frame's numbers may be anything, the servo refuses what is not finite."""
        place = frame.spheres(self._body, self._offset)[0]
        self._choose(place, frame.trap_position[0][self._hands])
        body, rows = self._body, place[self._chosen].tolist()
        spheres = tuple(SphereFrame(_vector(row), int(body[i])) for row, i in zip(rows, self._chosen, strict=True))
        traps = tuple(
            TrapFrame(t, _vector(row), power)
            for t, (row, power) in enumerate(
                zip(frame.trap_position[0].tolist(), frame.trap_power[0].tolist(), strict=True)
            )
        )
        load = float(frame.contact_load.max(initial=0.0))
        return SceneFrame(beat, frame.time, spheres, traps, load)

    def _choose(self, place: np.ndarray, foci: np.ndarray) -> None:
        """Fill the slots with the spheres nearest to the hands; one that stays keeps its slot, so that filters may."""
        if len(self._chosen) == len(place) or not len(foci):
            return
        gap = np.min(np.linalg.norm(place[:, None] - foci, axis=-1), axis=1)
        for kind in set(self.kinds):
            slots = np.flatnonzero(np.array(self.kinds) == kind)
            of_kind = np.flatnonzero(self._kind == kind)
            nearest = of_kind[np.argsort(gap[of_kind], kind="stable")[: len(slots)]]
            stay = np.isin(self._chosen[slots], nearest)
            self._chosen[slots[~stay]] = np.setdiff1d(nearest, self._chosen[slots[stay]], assume_unique=True)


def _vector(values: Sequence[float] | np.ndarray) -> Vec3:
    x, y, z = (float(v) for v in values)
    return x, y, z


def reach_of(law: Law) -> float:
    """Distance from the focus beyond which a law pulls no more [µm], inf if it has no end."""
    if isinstance(law, TableLaw):
        return law.grids[-1].end
    if isinstance(law, SplitLaw):
        return max(law.radial.cutoff, law.axial.cutoff) + abs(law.equilibrium)
    return law.curve.cutoff + abs(law.equilibrium) if isinstance(law, IsotropicLaw) else math.inf
