"""How steep the forces of traps are where beads leave them, and whether beads come there at all.

Beyond its threshold the paper's law falls several times as steeply as it rises; a law may jump there, and most end at
their cut-off with a jump. Escapes are decided on that side, so the step must see it, if the bead does: a well of many
k_B T is never left, unless drag and weight that pull the bead aside lower the barrier.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.forces.force import Load
from otwarp.scene import Scene
from otwarp.simulation.packing.optics import TrapOptics
from otwarp.simulation.packing.traps import law
from otwarp.simulation.time_step.relaxation import TrapRelaxation
from otwarp.simulation.time_step.speeds import flow_speed, sampled_speed
from otwarp.units import BOLTZMANN

REACHED = 30.0
"""Energy [k_B T] that thermal motion climbs in any run: e³⁰ relaxation times of a millisecond are 300 years."""

STARTED = 0.8
"""Distance over that at which a law leaves its linear branch, from which on a sphere starts beyond it."""

LATE = 0.5
"""Distance over that at which a law ends, from which on a sphere starts close to it, or is left there."""

JUMP, END, NARROW = 4.0, 3.0, 12.5
"""What makes an error as a slope does: the square of a jump of the force over k_B T; the force with which a law ends,
over that distance; and k_B T over its square, for a bead that diffuses out of the trap within few steps. Found with
`python -m benchmarks --only time_step`. Errors of a jump fall as the step to the power 1.5 only, and as the step itself
for a bead that starts beside it."""


def pulls(
    scene: Scene,
    moves: list[BodyMobility],
    values: Mapping[str, np.ndarray],
    loads: list[Load],
    held: tuple[tuple[int, int], ...],
) -> np.ndarray:
    """(T,) force that draws the sphere in each trap aside [pN]: drag of the flow and of authored motion, and steady
    forces; traps share that on the body which they hold, and one that holds nothing may come to any.
    """
    viscosity = float(values["medium_viscosity"].max())
    speed = sampled_speed(scene, values) + flow_speed(scene, values)
    whole = np.array([
        load.force + speed * viscosity / float(np.linalg.eigvalsh(move.mobility[:3, :3])[0])
        for load, move in zip(loads, moves, strict=True)
    ])  # fmt: skip
    bodies = np.array([b for b, _ in held], dtype=int)
    sharing = np.array([np.count_nonzero(bodies == b) for b in bodies])
    return np.where(bodies >= 0, whole[bodies] / np.maximum(sharing, 1), whole.max(initial=0.0))


def at_edges(
    scene: Scene,
    values: Mapping[str, np.ndarray],
    optics: TrapOptics,
    powers: np.ndarray,
    gap: np.ndarray,
    pull: np.ndarray,
) -> dict[str, np.ndarray]:
    """Parameters with the effective steepness of every trap as its stiffness [pN/µm], not per mW; 0 without an end.

    It is taken at the power, of all up to the trap's own, at which it counts most: the largest at which the bead still
    comes there.

    Args:
        values: The `(1|W, …)` parameters.
        optics: Of optical traps, which have their steepest slope about half-way up.
        powers: (T,) largest power of each trap [mW].
        gap: (T,) largest distance at which a sphere within the trap's reach starts from its equilibrium, or at which
            the trap leaves it behind [µm].
        pull: (T,) as `pulls`.
    """
    found = dict(values)
    authored = np.array([not trap.optical for trap in scene.traps], dtype=bool)
    slopes, depths = optics.steepest_slopes(), optics.depths()
    smallest = min((s.radius for b in scene.bodies for s in b.spheres if s.trapped), default=1.0)
    fitted = np.array([law(t).radius for t in scene.traps])
    # a smaller sphere than the law was fitted for lies in a shallower well
    shallower = np.where(fitted > 0.0, np.maximum(fitted / smallest, 1.0), 1.0)
    energy = BOLTZMANN * values["medium_temperature"]
    finer = max(0.01 / scene.settings.accuracy, 1.0)
    for curve in ("trap_", "trap_axial_"):
        k, threshold, square, offset, end = (
            np.asarray(values[curve + name], dtype=float)
            for name in ("stiffness", "threshold", "inverse_square", "offset", "cutoff")
        )
        begin = np.minimum(threshold, end)
        edged = authored & np.isfinite(begin) & (begin > 0.0)
        begin, last = np.where(edged, begin, 1.0), np.where(edged & np.isfinite(end), end, 1.0)
        branch = edged & (threshold < end)
        slope = np.where(branch, 2.0 * np.abs(square) / begin**3, 0.0)
        jump = np.where(branch, np.abs(square / begin**2 + offset - k * begin), 0.0)
        final = np.where(branch, np.abs(square / last**2 + offset), k * last) * np.isfinite(end)
        hottest, coldest = float(energy.max()), float(energy.min())
        acting = np.minimum(powers, reached_power(k, begin, hottest * shallower, pull))
        acting = np.where(gap > STARTED * begin, powers, acting)
        slow = np.where(gap > LATE * last, finer ** (1.0 / 3.0), finer ** (1.0 / 6.0))
        # without thermal motion a bead crosses a jump once, and there is no rate to be wrong
        jumping = JUMP * slow * (jump * acting) ** 2 / coldest if coldest > 0.0 else np.zeros_like(jump)
        falling = np.maximum(slope * acting, jumping)
        ending = np.maximum(END * final * acting / last, NARROW * hottest / last**2 * np.isfinite(end))
        held = np.divide(2.0 * REACHED * hottest, depths, out=np.zeros_like(depths), where=depths > 0.0)
        found[curve + "stiffness"] = np.where(
            authored, np.where(edged, np.maximum(falling, ending), 0.0), slopes * np.minimum(powers, held)
        )
    return found


def left_behind(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], held: tuple[tuple[int, int], ...]
) -> np.ndarray:
    """(T,) how far behind its focus each trap leaves what it holds when it follows its time samples, at most [µm].

    In the spring of its softer direction, at the least power that it ever has: ẋ = (kP/γ)·(f − x) from sample to
    sample, traps of one body sharing its drag. Commands during a run are not known beforehand.
    """
    viscosity = float(values["medium_viscosity"].max())
    drags = [viscosity / float(np.linalg.eigvalsh(move.mobility[:3, :3])[0]) for move in moves]
    stiffness = np.minimum(values["trap_stiffness"], values["trap_axial_stiffness"]).min(axis=0)
    limits = values["trap_speed_limit"].max(axis=0)
    bodies = [b for b, _ in held]
    far = np.zeros(len(scene.traps))
    for t, (trap, b) in enumerate(zip(scene.traps, bodies, strict=True)):
        times, points = trap.position.times, trap.position.values
        if len(times) < 2:
            continue
        powers = np.concatenate([values["trap_power"][:, t], trap.power.values.ravel()])
        least = float(powers.min(where=powers > 0.0, initial=np.inf))
        spring = stiffness[t] * least if np.isfinite(least) else 0.0
        if spring == 0.0:
            continue
        rate = spring / (drags[b] / bodies.count(b) if b >= 0 else max(drags))
        spans, ways = np.diff(times), np.diff(points, axis=0)
        speeds = np.linalg.norm(ways, axis=1) / spans
        ways *= np.minimum(1.0, limits[t] / np.where(speeds > 0.0, speeds, 1.0))[:, None]
        lag = np.zeros(3)
        for way, kept in zip(ways / (rate * spans)[:, None], np.exp(-rate * spans), strict=True):
            lag = kept * lag + (1.0 - kept) * way
            far[t] = max(far[t], float(np.linalg.norm(lag)))
    return far


def close_starts(values: Mapping[str, np.ndarray], gap: np.ndarray) -> np.ndarray:
    """(T,) whether a sphere starts close to where a trap ends, or is left there; arguments as for `at_edges`."""
    ends = [values[name].max(axis=0) for name in ("trap_cutoff", "trap_axial_cutoff")]
    return np.any([np.isfinite(end) & (gap > LATE * end) for end in ends], axis=0)


@dataclass(frozen=True)
class Edges:
    """Rates where beads leave the traps.

    Attributes:
        rates: With the parameters of `at_edges`, at powers of 1.
        close: (T,) as `close_starts`.
    """

    rates: TrapRelaxation
    close: np.ndarray

    @property
    def leaving(self) -> float:
        """The fastest [1/s]."""
        return self._fastest(np.ones(len(self.close)))

    @property
    def starting(self) -> float:
        """That of the traps close to whose end a sphere starts or is left [1/s]."""
        return self._fastest(self.close.astype(float))

    def _fastest(self, powers: np.ndarray) -> float:
        return self.rates.fastest(powers)[0] if (powers * self.rates.stiffness).any() else 0.0


def reached_power(stiffness: np.ndarray, distance: np.ndarray, energy: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """Largest power [mW] at which a bead comes as far from the equilibrium as `distance` [µm].

    Where the pull holds it, F/kP away, and thermal motion of `REACHED` carries it √(2·REACHED·k_B T/kP) beyond.

    Args:
        stiffness: Of the linear branch [pN/µm per mW]; with 0 it comes there at any power.
        energy: k_B T [pN·µm].
        pull: F [pN].
    """
    thermal = np.sqrt(2.0 * REACHED * energy)
    # 2·distance over this is the root of the power's inverse, so that a bead which nothing moves needs no power
    carried = thermal + np.sqrt(thermal**2 + 4.0 * pull * distance)
    held = (carried / (2.0 * distance)) ** 2 / np.where(stiffness > 0.0, stiffness, 1.0)
    return np.where(stiffness > 0.0, held, np.inf)
