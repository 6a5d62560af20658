"""What limits the time step of a scene, and the step that follows from it and the wanted accuracy."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.hydrodynamics.mobility import BodyMobility
from otwarp.kernels.forces.force import Load
from otwarp.kernels.integrate.integrators import INTEGRATORS, Integrator
from otwarp.scene import Scene
from otwarp.simulation.packing.walls import wall_time
from otwarp.simulation.time_step.contact_errors import in_contact
from otwarp.simulation.time_step.edges import Edges
from otwarp.simulation.time_step.observables import (
    ErrorSource,
    ExplicitStep,
    at_edges,
    errors,
    from_close,
    in_springs,
    missed,
    near_walls,
)
from otwarp.simulation.time_step.relaxation import TrapRelaxation
from otwarp.simulation.time_step.rotors import in_rotation, rotors
from otwarp.simulation.time_step.sampling import in_samples
from otwarp.simulation.time_step.speeds import (
    adhesion_speed,
    authored_powers,
    flow_speed,
    places,
    prescribed_speed,
    settling_speed,
    turning_rate,
)
from otwarp.units import BOLTZMANN

TRAVEL_FRACTION = 0.1
"""Largest displacement per step of anything that collides, relative to the smallest colliding radius."""

WALL_PRODUCT = 0.5
"""Step over wanted accuracy and the time of `TimeScales.wall`.

Measured on heavy spheres above a wall: with this step the mean height errs by less than a third of the accuracy, and
the number of spheres within a tenth of the mean gap by about the accuracy.
"""

TURN = 0.1
"""Largest turn of a rigid body per step by flow and weight [rad]."""


MARGIN = 0.5
"""Chosen step over the largest stable one, with coupled bodies as near to each other as they can come."""


@dataclass(frozen=True, kw_only=True)
class TimeScales:
    """What limits the time step; times in s, `None` where the scene has no such process.

    Attributes:
        trap_relaxation: Fastest relaxation in the traps, 1/rate.
        stiffest_body: Name of the body it belongs to.
        diffusion: Time to diffuse `TRAVEL_FRACTION` of the smallest colliding radius.
        travel: Time in which the fastest trap, obstacle (its turning included) or flow moves by that much.
        settling: Time in which the heaviest body sinks or rises by that much.
        adhesion: Time in which the pull-off force closes a gap of that much.
        turning: Time in which flow and weight turn a rigid body by `TURN`.
        wall: Time in which a sphere diffuses or falls by its radius, where a hydrodynamic wall is.
        time_step: Step in use.
        largest_stable: Largest stable step, inf without traps; of coupled bodies where they start.
        integrator: Name of the integrator.
        errors: Estimated relative error of what the step may make wrong, by the names of `OBSERVABLES`; in traps of
            the stiffest mode.
        accuracy: Wanted relative error of all of these.
        chosen_by: What decided the step; never longer than a frame.
    """

    trap_relaxation: float | None
    stiffest_body: str | None
    diffusion: float | None
    travel: float | None
    settling: float | None
    adhesion: float | None
    turning: float | None
    wall: float | None
    time_step: float
    largest_stable: float
    integrator: str
    errors: dict[str, float]
    accuracy: float
    chosen_by: str

    @property
    def missed(self) -> dict[str, float]:
        """Those of `errors` above the wanted accuracy: with a chosen step, what no affordable one makes small."""
        return missed(self.errors, self.accuracy)


def _within(distance: float, speed: float) -> float | None:
    return distance / speed if speed > 0.0 else None


def _motions(
    scene: Scene, moves: list[BodyMobility], values: Mapping[str, np.ndarray], loads: list[Load], contacts: bool
) -> dict[str, float | None]:
    """Times to be moved `TRAVEL_FRACTION` of the smallest colliding radius, and to turn by `TURN` [s]."""
    viscosity = float(values["medium_viscosity"].min())
    turning = _within(TURN, turning_rate(scene, moves, values, loads, viscosity))
    if not contacts:
        return dict.fromkeys(("diffusion", "travel", "settling", "adhesion")) | {"turning": turning}
    small = TRAVEL_FRACTION * min(element.radius for b in scene.bodies for element in b.colliding)
    hot = float(values["medium_temperature"].max()) if scene.settings.brownian else 0.0
    spread = max(BOLTZMANN * hot * m.mobility[0, 0] / viscosity for m in moves)
    return {
        "diffusion": float(small**2 / (2.0 * spread)) if spread > 0.0 else None,
        "travel": _within(small, prescribed_speed(scene, values)),
        "settling": _within(small, settling_speed(moves, loads, viscosity)),
        "adhesion": _within(small, adhesion_speed(scene, moves, viscosity)),
        "turning": turning,
    }


_LIMITS = {
    "diffusion": "diffusion of the smallest colliding sphere",
    "travel": "fastest prescribed motion",
    "settling": "sinking or rising under weight",
    "adhesion": "approach under adhesion",
    "turning": "turning of rigid bodies by flow and weight",
}
"""What is reported when a time of `_motions` decides the step."""


@dataclass(frozen=True)
class Stability:
    """Up to which step an integrator is stable where forces are steepest.

    Attributes:
        product: Smallest unstable rate times step of the integrator [1].
        rate: Fastest relaxation there, with the bodies where they start [1/s].
        body: Name of the body it belongs to.
        utmost: The same with coupled bodies as near to each other as they can come [1/s].
    """

    product: float
    rate: float
    body: str | None
    utmost: float

    @classmethod
    def of(cls, scheme: Integrator, steepest: TrapRelaxation, powers: np.ndarray) -> Stability:
        """From the rates where forces are steepest, at the powers (T,) [mW]."""
        return cls(scheme.stable, *steepest.fastest(powers), steepest.fastest(powers, anywhere=True)[0])

    @property
    def largest(self) -> float:
        """Largest stable step with the bodies where they start [s], inf without traps."""
        return self.product / self.rate if self.rate > 0.0 else math.inf

    def check(self, wanted: float, what: str) -> None:
        """Refuse an unstable step [s], called `what`; warn of one that becomes unstable where bodies meet.

        Raises:
            InputError: Not positive, or unstable; the message names the largest stable step.
        """
        if not 0.0 < wanted < math.inf:
            raise InputError(f"{what} is {wanted:g} s; allowed: above 0 and below {self.largest:.4g} s")
        if wanted >= self.largest:
            raise InputError(
                f"{what} {wanted:g} s is unstable: body {self.body} relaxes at {self.rate:.4g} 1/s; "
                f"allowed: above 0 and below {self.largest:.4g} s"
            )
        if wanted * self.utmost >= self.product:
            warnings.warn(
                f"time step {wanted:g} s becomes unstable where all trapped bodies are as near to each other as they "
                f"can come, because they are coupled; always stable: below {self.product / self.utmost:.4g} s",
                stacklevel=3,
            )


def time_scales(
    scene: Scene,
    moves: list[BodyMobility],
    values: Mapping[str, np.ndarray],
    relaxation: TrapRelaxation,
    steepest: TrapRelaxation,
    edges: Edges,
    loads: list[Load],
    *,
    integrator: str,
    contacts: bool,
    explicit: ExplicitStep | None,
) -> TimeScales:
    """Time scales of a scene, and the longest step that all observables allow; in springs those of the stiffest mode.

    Args:
        values: The `(1|W, …)` parameters of `parameters.PARAMETERS`.
        relaxation: Rates in the traps near their equilibria.
        steepest: Rates where forces are steepest, of tables at the rim of a sphere; they limit stability.
        edges: Rates where beads leave the traps, as far as they come there.
        loads: Per body, how strong all forces but traps are.
        contacts: Whether anything can touch anything.
        explicit: None to choose the step.

    Raises:
        InputError: An explicit step that is not positive, unstable, or errs too much; the message names a better one.
    """
    scheme, powers = INTEGRATORS[integrator], authored_powers(scene, values)
    rate, stiffest = relaxation.fastest(powers)
    stability = Stability.of(scheme, steepest, powers)
    motions = _motions(scene, moves, values, loads, contacts)
    wall = wall_time(scene, values, loads)
    watched = _observables(scene, scheme, rate, edges, wall)
    if contacts and scene.settings.brownian:
        watched += in_contact(scene, moves, values, relaxation, powers, loads)
    watched += in_rotation(rotors(scene, moves, values, loads, scheme), scene.settings.accuracy)
    if explicit is None:
        limits = _step_limits(scene, scheme, rate, stability, motions, watched)
    else:
        stability.check(explicit.step, explicit.what)
        limits = {"set by the user": explicit.step}
    sampled = in_samples(scene, values, contacts=contacts, longest=min(limits.values()))
    watched += sampled
    if explicit is None:
        limits |= {row.limit: row.longest for row in sorted(sampled, key=lambda row: -row.longest)}
    else:
        explicit.check(watched, scene.settings.accuracy)
    chosen_by = min(limits, key=lambda name: limits[name])
    step = limits[chosen_by] if explicit else whole_steps(scene.settings.duration, limits[chosen_by])
    return TimeScales(
        trap_relaxation=1.0 / rate if rate > 0.0 else None,
        stiffest_body=stiffest,
        **motions,
        wall=wall,
        time_step=step,
        largest_stable=stability.largest,
        integrator=integrator,
        errors=errors(watched, step),
        accuracy=scene.settings.accuracy,
        chosen_by=chosen_by,
    )


def _observables(scene: Scene, scheme: Integrator, rate: float, edges: Edges, wall: float | None) -> list[ErrorSource]:
    """What the step of a scene may make wrong, apart from contact, rotation and samples.

    Args:
        rate: Fastest relaxation near the equilibria of the traps [1/s].
        edges: Where beads leave them.
        wall: As in `TimeScales`.
    """
    accuracy, noise, brownian = scene.settings.accuracy, scene.settings.noise, scene.settings.brownian
    watched = in_springs(scheme, rate, accuracy, noise, brownian=brownian)
    if brownian:
        watched += at_edges(scheme, edges.leaving, accuracy, noise)
        watched += from_close(scheme, edges.starting, accuracy, noise)
    if wall is not None:
        watched.append(near_walls(WALL_PRODUCT * accuracy * wall, accuracy))
    return watched


def whole_steps(duration: float, longest: float) -> float:
    """The step of at most `longest` [s] of which a run of `duration` [s] is a whole number, so that it ends on time."""
    return duration / math.ceil(duration / longest * (1.0 - 1e-12))


def _step_limits(
    scene: Scene,
    scheme: Integrator,
    rate: float,
    stability: Stability,
    motions: Mapping[str, float | None],
    watched: list[ErrorSource],
) -> dict[str, float]:
    """Longest step [s] that each of what limits it allows, by what is reported of it.

    Args:
        rate: Fastest relaxation near the equilibria of the traps [1/s].
        motions: As `_motions` gives them.
        watched: As `_observables` gives them.
    """
    rim, utmost = stability.rate, stability.utmost
    steep = scheme.rim_product(scene.settings.accuracy, scene.settings.noise)
    return {
        "steepest slope of a trap's force": steep / rim if rim > rate else math.inf,
        **{row.limit: row.longest for row in sorted(watched, key=lambda row: -row.longest)},
        **{text: motions[name] or math.inf for name, text in _LIMITS.items()},
        "stability of coupled bodies that meet": MARGIN * scheme.stable / utmost if utmost > rim else math.inf,
        "frame interval": 1.0 / scene.settings.frames_per_second,
    }


def warn_of_lost_motion(
    scene: Scene,
    moves: list[BodyMobility],
    values: Mapping[str, np.ndarray],
    loads: list[Load],
    time_step: float,
    *,
    brownian: bool,
    precision: str = "float32",
) -> None:
    """Warn when noise, flow, weight or the speed limit of a trap moves less per step than coordinates resolve.

    Far from the origin a small step of float32 coordinates rounds to nothing, every time. Noise dithers the steps of
    bodies, so with it flow and weight act in the mean; a focus has no noise. A trap that moves slowly along its time
    samples loses nothing, because its place is computed anew in every step.
    """
    viscosity = float(values["medium_viscosity"].min())
    limits = values["trap_speed_limit"]
    steady = 0.0 if brownian else max(flow_speed(scene, values), settling_speed(moves, loads, viscosity))
    slowest = float(limits[np.isfinite(limits)].min(initial=np.inf))
    extent = float(np.abs(places(scene, values)).max())
    spacing = float(np.spacing(np.dtype(precision).type(extent)))
    for what, speed in (("flow or weight, without noise,", steady), ("the speed limit of a trap,", slowest)):
        if 0.0 < speed * time_step < spacing:
            warnings.warn(
                f"scene {scene.file or scene.root}: {what} of {speed:.3g} µm/s in time steps of {time_step:.3g} s is "
                f"lost in the rounding of {precision} coordinates at {extent:.3g} µm; "
                f"allowed: time steps above {spacing / speed:.3g} s, or a scene nearer to the origin",
                stacklevel=2,
            )
    cold = float(values["medium_temperature"].min())
    mobile = min(m.mobility[0, 0] for m in moves) / float(values["medium_viscosity"].max())
    spread = math.sqrt(2.0 * BOLTZMANN * cold * mobile * time_step) if brownian else 0.0
    # noise that moves nothing visible over the whole run is not missed
    seen = spread * math.sqrt(scene.settings.duration / time_step) > 10.0 * spacing
    if 0.0 < spread < spacing and seen:
        warnings.warn(
            f"scene {scene.file or scene.root}: thermal displacements of {spread:.3g} µm in time steps of "
            f"{time_step:.3g} s are falsified by the rounding of {precision} coordinates, {spacing:.3g} µm at "
            f"{extent:.3g} µm; allowed: time steps above {time_step * (spacing / spread) ** 2:.3g} s, or a scene "
            "nearer to the origin",
            stacklevel=2,
        )
