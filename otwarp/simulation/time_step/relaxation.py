"""How fast bodies relax in the traps: which trap acts on which sphere, and the rate that follows from the powers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.hydrodynamics.rpy import cross_matrix
from otwarp.kernels.forces.force import Load
from otwarp.scene import Body, Scene
from otwarp.scene.period import nearest
from otwarp.simulation.packing.traps import axial_or_radial, beam_axis, equilibrium_points, law, rotate, trap_reach
from otwarp.simulation.time_step.coupled_rates import CoupledRates


@dataclass(frozen=True, eq=False)
class Neighbours:
    """The spheres that traps act on, and how near the traps are to them at the start; S spheres.

    Attributes:
        sphere: (S, 2) body and index in the body.
        gap: (T, S) distance from the equilibrium point to the sphere's centre, least over the worlds [µm].
        within: (T, S) whether the sphere is in the trap's reach in any world.
    """

    sphere: np.ndarray
    gap: np.ndarray
    within: np.ndarray

    @classmethod
    def of(cls, scene: Scene, values: Mapping[str, np.ndarray], hold: np.ndarray) -> Neighbours:
        """Measure a scene at its start, for traps as `values` place them.

        `hold` is the (T,) distance within which an optical trap can hold a sphere [µm]: its weak force reaches on, but
        changes nobody's relaxation. Inf for the others.
        """
        rows = [(b, i) for b, body in enumerate(scene.bodies) for i, s in enumerate(body.spheres) if s.trapped]
        place = np.array([_sphere_position(scene.bodies[b], i) for b, i in rows]).reshape(-1, 3)
        radii = np.array([scene.bodies[b].spheres[i].radius for b, i in rows])
        anchors, unit = equilibrium_points(scene, values), trap_reach(scene, values, 1.0)
        gap = np.zeros((len(scene.traps), len(rows)))
        within = np.zeros(gap.shape, dtype=bool)
        for t, trap in enumerate(scene.traps):
            distance = np.linalg.norm(nearest(place - anchors[:, t, None], scene.settings.period), axis=2)
            gap[t] = distance.min(axis=0)
            reach = np.minimum(unit[:, t, None] * (radii if law(trap).radius > 0.0 else 1.0), hold[t])
            within[t] = (distance <= reach).any(axis=0)
        return cls(np.array(rows, dtype=int).reshape(-1, 2), gap, within)

    def held(self, scene: Scene) -> tuple[tuple[int, int], ...]:
        """(body, sphere) of each trap: the one it names, else the nearest at the start if it is within reach."""
        named = {s.prim: (b, i) for b, body in enumerate(scene.bodies) for i, s in enumerate(body.spheres)}
        held = []
        for t, trap in enumerate(scene.traps):
            first = int(np.argmin(self.gap[t])) if len(self.sphere) else -1
            if trap.holds is not None:
                held.append(named[trap.holds])
            elif first >= 0 and self.within[t, first]:
                held.append((int(self.sphere[first, 0]), int(self.sphere[first, 1])))
            else:
                held.append((-1, -1))
        return tuple(held)


def _sphere_position(body: Body, i: int) -> np.ndarray:
    return np.array(body.position) + rotate(np.array(body.orientation), np.array(body.spheres[i].offset))


def lever(offset: np.ndarray) -> np.ndarray:
    """(3, 6) velocity of the point at `offset` [µm] from the reference, by velocity and angular velocity."""
    return np.hstack([np.eye(3), -cross_matrix(offset)])


def point_mobility(move: BodyMobility, point: np.ndarray) -> float:
    """Largest mobility of a point of a body, given in its prim's frame, at unit viscosity [1/µm].

    A force there also turns the body, so an end of a rod gives way more easily than its middle.
    """
    j = lever(np.asarray(point) - move.reference)
    return float(np.linalg.eigvalsh(j @ move.mobility @ j.T).max())


def mean_point_mobility(move: BodyMobility, point: np.ndarray) -> float:
    """Mean over the directions of the mobility of a point of a body, as `point_mobility` [1/µm]."""
    j = lever(np.asarray(point) - move.reference)
    return float(np.trace(j @ move.mobility @ j.T)) / 3.0


@dataclass(frozen=True, eq=False)
class _BodyModes:
    """Rates of one body per mW at unit viscosity; M = L Lᵀ.

    Attributes:
        body: Its index in the scene.
        acting: (n,) traps that hold it, or reach it at the start.
        matrix: (n, 6, 6) Lᵀ Jᵀ K J L of each; their sum over power has the relaxation rates as eigenvalues.
        spheres: (m, 6, 6) Lᵀ Jᵀ J L of its trapped spheres, the most mobile first.
        radii: (m,) of these [µm].
        single: (m,) largest eigenvalue of each.
    """

    body: int
    acting: np.ndarray
    matrix: np.ndarray
    spheres: np.ndarray
    radii: np.ndarray
    single: np.ndarray


@dataclass(frozen=True, eq=False)
class TrapRelaxation:
    """Fastest relaxation in the traps as a function of their powers.

    A trap counts on the sphere it holds, wherever either is at the start, and on the nearest sphere of any other body
    that it reaches at the start. A trap that holds nothing may come to any body, so it counts on all of them: at most
    one such trap per sphere, the stiffest traps on the most mobile spheres. And every single trap counts alone on the
    most mobile sphere of each body, because a sphere may be lost to another trap.

    Attributes:
        names: Name of each body.
        viscosity: Least of all worlds [Pa·s].
        stiffness: (T,) stiffest direction of each trap, most of all worlds [pN/µm per mW].
        law_radius: (T,) sphere radius the law holds for [µm], 0 for any.
        wandering: (T,) traps that hold nothing.
        modes: One entry per body that a trap acts on, and one per kind of the others.
        coupled: How much faster the bodies that traps act on, or may come to, relax together, or None without coupling.
        others: Fastest relaxation by all forces but traps, times viscosity [Pa]; on top of any trap's, to be safe.
        other_body: Name of the body it belongs to.
    """

    names: tuple[str, ...]
    viscosity: float
    stiffness: np.ndarray
    law_radius: np.ndarray
    wandering: np.ndarray
    modes: tuple[_BodyModes, ...]
    coupled: CoupledRates | None = None
    others: float = 0.0
    other_body: str | None = None

    @classmethod
    def of(
        cls,
        scene: Scene,
        moves: list[BodyMobility],
        values: Mapping[str, np.ndarray],
        near: Neighbours,
        held: tuple[tuple[int, int], ...],
        loads: list[Load] | None = None,
    ) -> TrapRelaxation:
        """Prepare the rates of a scene with the parameters `values`."""
        curves = np.array([values["trap_stiffness"].max(axis=0), axial_or_radial(scene, values, "stiffness").max(0)])
        by_body: dict[int, dict[int, int]] = {}
        for t, (b, i) in enumerate(held):
            if b >= 0:
                by_body.setdefault(b, {})[t] = i
            for k in np.argsort(np.where(near.within[t], near.gap[t], np.inf), kind="stable")[: near.within[t].sum()]:
                by_body.setdefault(int(near.sphere[k, 0]), {}).setdefault(t, int(near.sphere[k, 1]))
        modes, seen = [], set()
        for b, (body, move) in enumerate(zip(scene.bodies, moves, strict=True)):
            kind = (id(move), tuple((s.offset, s.radius) for s in body.spheres if s.trapped))
            if not kind[1] or (b not in by_body and kind in seen):
                continue
            seen.add(kind)
            modes.append(_body_modes(scene, b, move, by_body.get(b, {}), curves))
        acting = [m.body for m in modes if len(m.acting)]
        wandering = np.array([b < 0 for b, _ in held], dtype=bool)
        rates = [load.rate for load in loads or ()]
        worst = int(np.argmax(rates)) if any(rates) else None
        reachable = sorted({int(b) for b, _ in near.sphere}) if wandering.any() else acting
        return cls(
            names=tuple(b.name for b in scene.bodies),
            viscosity=float(values["medium_viscosity"].min()),
            stiffness=curves.max(axis=0),
            law_radius=np.array([law(t).radius for t in scene.traps]),
            wandering=wandering,
            modes=tuple(modes),
            coupled=CoupledRates.of(scene, moves, acting, reachable),
            others=rates[worst] if worst is not None else 0.0,
            other_body=scene.bodies[worst].name if worst is not None else None,
        )

    def fastest(self, powers: np.ndarray, *, anywhere: bool = False) -> tuple[float, str | None]:
        """Fastest relaxation rate [1/s] with traps of `powers` (T,) [mW], and the body it belongs to.

        Coupled bodies count where they start, or with `anywhere` as near to each other as they can come.
        """
        best, name = 0.0, None
        for mode in self.modes:
            rate = self._rate(mode, powers) / self.viscosity
            if rate > best:
                best, name = rate, self.names[mode.body]
        best += self.others / self.viscosity
        return best * self._gain(powers, anywhere), name or self.other_body

    def _gain(self, powers: np.ndarray, anywhere: bool) -> float:
        """How much faster coupled bodies relax together than the fastest of them alone."""
        if self.coupled is None:
            return 1.0
        if anywhere:
            return self.coupled.largest_gain
        acting = [m for m in self.modes if len(m.acting)]
        return self.coupled.gain([np.einsum("t,tij->ij", powers[m.acting], m.matrix) for m in acting])

    def _rate(self, mode: _BodyModes, powers: np.ndarray) -> float:
        """Fastest rate of one body at unit viscosity."""
        if not len(powers):
            return 0.0
        # (T, m) stiffness of each trap for each sphere: a law fitted for another radius is stretched
        scale = np.where(self.law_radius[:, None] > 0.0, self.law_radius[:, None] / mode.radii, 1.0)
        stiffness = (powers * self.stiffness)[:, None] * scale
        total = np.einsum("t,tij->ij", powers[mode.acting], mode.matrix)
        others = np.setdiff1d(np.flatnonzero(self.wandering), mode.acting)
        strongest = others[np.argsort(-powers[others] * self.stiffness[others], kind="stable")]
        for s, t in enumerate(strongest[: len(mode.radii)]):
            total = total + stiffness[t, s] * mode.spheres[s]
        return max(float((stiffness * mode.single).max()), float(np.linalg.eigvalsh(total).max()))


def _body_modes(scene: Scene, b: int, move: BodyMobility, acting: dict[int, int], curves: np.ndarray) -> _BodyModes:
    """Modes of body `b` for the traps `acting` on its spheres (trap → sphere); `curves` (2, T) stiffness per mW."""
    body = scene.bodies[b]
    matrices = []
    for t, i in acting.items():
        sphere, radius = body.spheres[i], law(scene.traps[t]).radius
        # the beam in the body's frame
        axis = rotate(np.array(body.orientation) * [-1.0, -1.0, -1.0, 1.0], beam_axis(scene.traps[t]))
        along = np.outer(axis, axis)
        k = curves[0, t] * (np.eye(3) - along) + curves[1, t] * along
        j = lever(np.array(sphere.offset) - move.reference) @ move.cholesky
        matrices.append((radius / sphere.radius if radius > 0.0 else 1.0) * (j.T @ k @ j))
    trapped = [s for s in body.spheres if s.trapped]
    levers = np.array([lever(np.array(s.offset) - move.reference) @ move.cholesky for s in trapped])
    spheres = levers.transpose(0, 2, 1) @ levers
    single = np.linalg.eigvalsh(spheres)[:, -1]
    order = np.argsort(-single, kind="stable")
    return _BodyModes(
        body=b,
        acting=np.array(list(acting), dtype=int),
        matrix=np.array(matrices).reshape(-1, 6, 6),
        spheres=spheres[order],
        radii=np.array([s.radius for s in trapped])[order],
        single=single[order],
    )
