"""Escape detection: the first step in which a trap loses the sphere it holds.

A sphere has escaped when it is out of the trap's reach at the end of a step, or was in between: a Brownian path that
starts the step at d₀ and ends it at d₁ inside a boundary has crossed it with probability exp(−2 d₀ d₁/s²), s² the
variance of the step's displacement along one axis (Gobet 2000, doi:10.1016/S0304-4149(99)00109-X; the boundary counts
as flat). Without this, escapes come late by O(√dt).
"""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import thermal_energy_of, viscosity_of
from otwarp.kernels.core.packed import point_of, power_of
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.random import Stream, noise_words, uniform
from otwarp.kernels.core.roots import reciprocal_root, square_root
from otwarp.kernels.core.step_constants import BeadConstants
from otwarp.kernels.core.types import ControlData, ModelData, Pose, ReadoutData, StateData, TrapData, world_row
from otwarp.kernels.core.worlds import number_term
from otwarp.kernels.optics.trap_command import anchor_of, trap_command_term

NEAR = wp.constant(5.0)
"""Distance from the boundary, in standard deviations s of a step, beyond which no crossing is looked for: had both ends
been that far inside, one would happen with probability e⁻⁵⁰."""


@wp.func
def crossed(
    seed: wp.uint32, world: int, trap: int, step: wp.int64, reach: float, before2: float, after2: float, s2: float
) -> bool:
    """Whether the path of a step between two squared distances [µm²] inside `reach` [µm] went out and came back:
    with probability exp(−2 d₀ d₁/s²), see the module.
    """
    per_s = reciprocal_root(s2)
    inside = 2.0 * (reach - square_root(before2)) * (reach - square_root(after2)) * per_s * per_s
    words = noise_words(seed, wp.static(wp.uint32(Stream.CROSSING)), step, world, trap)
    return uniform(words[0]) < wp.exp(-inside)


def escape_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, world, b, before, pose, step, time) -> leeway`: record when spheres are lost.

    `step` and `time` are those of the arrival at `pose`, from `before`. A focus with a speed limit counts as where it
    has come to, at both ends of the step. As long as points of the body and traps that glide have not moved by the
    leeway [µm] together, nothing can be lost.
    """
    record_escape = trap_escape_term(f)

    @wp.func
    def record_escapes(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, world: int, b: int,
        before: Pose, pose: Pose, step: wp.int64, time: wp.float64,
    ) -> float:  # fmt: skip
        """Record the escapes of body b in this step; returns the leeway [µm], inf where no trap holds it."""
        leeway = float(wp.inf)
        for trap in range(model.traps.axis.shape[0]):
            if model.traps.held_body[trap] == b:
                left = record_escape(model, control, state, readout, world, trap, before, pose, step, time)
                leeway = wp.min(leeway, left)
        return leeway

    return record_escapes


@wp.func
def gliding_way(model: ModelData, control: ControlData, world: int) -> float:
    """How far the fastest trap that glides goes in a step [µm]."""
    fastest = float(0.0)
    for trap in range(control.trap_velocity.shape[1]):
        fastest = wp.max(fastest, wp.length(control.trap_velocity[world, trap]))
    return fastest * wp.float32(model.time_step)


def way_term(f: Features) -> wp.Function:
    """`(model, control, world, moved, turned, bound) -> float`: how far a body and a trap come apart at most."""

    @wp.func
    def way(model: ModelData, control: ControlData, world: int, moved: wp.vec3, turned: wp.vec3, bound: float) -> float:
        """Way [µm] of a point within `bound` [µm] of a body that moved [µm] and turned [rad], and of a gliding trap."""
        most = wp.length(moved) + bound * wp.length(turned)
        if wp.static(f.gliding_traps):
            most += gliding_way(model, control, world)
        return most

    return way


def trap_escape_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, world, trap, before, pose, step, time) -> leeway` of the body a trap holds."""
    trap_command = trap_command_term(f)
    number = number_term(f)

    @wp.func
    def distance2(model: ModelData, trap: int, command: wp.vec4, pose: Pose) -> float:
        """Squared distance of the held sphere from the equilibrium point [µm²]."""
        held = pose.position + wp.quat_rotate(pose.rotation, model.traps.held_offset[trap])
        away = held - anchor_of(model, trap, command)
        if wp.static(f.periodic):
            away = nearest(model.period, away)
        return wp.length_sq(away)

    @wp.func
    def record_escape(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, world: int, trap: int,
        before: Pose, pose: Pose, step: wp.int64, time: wp.float64,
    ) -> float:  # fmt: skip
        """Record the escape from a trap in this step; returns the leeway [µm], inf if it holds nothing any more."""
        leeway = float(wp.inf)
        if readout.escape_step[world, trap] < wp.int64(0):
            command = trap_command(model, control, state, world, trap, time)
            reach = model.traps.held_range[world_row(model.traps.held_range.shape[0], world), trap]
            after2 = distance2(model, trap, command, pose)
            near = reach
            # a dark trap holds nothing that could escape
            lost = power_of(command) > 0.0 and after2 > reach * reach
            if wp.static(f.brownian and f.crossings):
                if power_of(command) > 0.0 and not lost:
                    s2 = spread2(model, world, trap)
                    near = wp.max(reach - NEAR * wp.sqrt(s2), 0.0)
                    start = trap_command(model, control, state, world, trap, time - model.time_step)
                    before2 = distance2(model, trap, start, before)
                    if wp.max(before2, after2) > near * near and before2 < reach * reach:
                        lost = crossed(
                            model.seed, number(model, world), trap, step - wp.int64(1), reach, before2, after2, s2
                        )  # fmt: skip
            if lost:
                readout.escape_step[world, trap] = step
            elif power_of(command) > 0.0:
                leeway = wp.min(leeway, near - wp.sqrt(after2))
            if wp.static(not f.kept_traps):
                leeway = 0.0
        return leeway

    return record_escape


@wp.func
def spread2(model: ModelData, world: int, trap: int) -> float:
    """Variance of the thermal displacement of a held sphere along one axis in one step [µm²]."""
    viscosity = viscosity_of(model, world)
    energy = thermal_energy_of(model, world)
    return 2.0 * energy * model.traps.held_mobility[trap] / viscosity * wp.float32(model.time_step)


@wp.struct
class EscapeMonitor:
    """One trap's view of a lone sphere, kept in registers over a launch."""

    reach: wp.float32  # distance at which the sphere has escaped [µm], inf if the trap does not hold it or lost it
    near2: wp.float32  # squared distance beyond which it may have left and come back within a step [µm²]
    last2: wp.float32  # squared distance one step ago [µm²]
    escape: wp.int32  # steps of this launch after which it was lost, -1: never


@wp.func
def start_monitor(
    traps: TrapData, readout: ReadoutData, bead: BeadConstants, world: int, b: int, trap: int
) -> EscapeMonitor:
    """Monitor the sphere that a trap holds, unless it is another one or has escaped before."""
    monitor = EscapeMonitor()
    monitor.reach = traps.held_range[world_row(traps.held_range.shape[0], world), trap]
    if traps.held_body[trap] != b or readout.escape_step[world, trap] >= wp.int64(0) or bead.trapped == 0:
        monitor.reach = wp.inf
    near = wp.max(monitor.reach - NEAR * bead.spread, 0.0)
    monitor.near2 = near * near
    monitor.escape = -1
    return monitor


def monitor_term(f: Features) -> wp.Function:
    """`(model, bead, monitor, anchor, world, trap, position, first, taken) -> monitor` after `taken` steps."""
    number = number_term(f)

    @wp.func
    def monitored(
        model: ModelData, bead: BeadConstants, monitor: EscapeMonitor, anchor: wp.vec4, world: int, trap: int,
        position: wp.vec3, first: wp.int64, taken: int,
    ) -> EscapeMonitor:  # fmt: skip
        """The monitor after a look at `position` [µm]: lost if out of reach of a lit trap, now or in between."""
        # the same displacement as the force of the step needs, so that it is computed once
        away = position - point_of(anchor)
        if wp.static(f.periodic):
            away = nearest(model.period, away)
        away2 = wp.length_sq(away)
        if wp.max(away2, monitor.last2) > monitor.near2 and power_of(anchor) > 0.0:
            lost = away2 > monitor.reach * monitor.reach
            if wp.static(f.brownian and f.crossings):
                if taken > 0 and not lost:
                    step = first + wp.int64(taken - 1)
                    s2 = bead.spread * bead.spread
                    n = number(model, world)
                    lost = crossed(model.seed, n, trap, step, monitor.reach, monitor.last2, away2, s2)
            if lost:
                monitor.escape = taken
                monitor.reach = wp.inf
                monitor.near2 = wp.inf
        monitor.last2 = away2
        return monitor

    return monitored


@wp.func
def report_escape(readout: ReadoutData, monitor: EscapeMonitor, world: int, trap: int, first: wp.int64):
    """Write the step of a loss; a sphere that starts out of reach escapes with the first step."""
    if monitor.escape >= 0:
        readout.escape_step[world, trap] = first + wp.int64(wp.max(monitor.escape, 1))
