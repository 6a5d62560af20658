"""Escape detection: the first step in which a trap loses the sphere it holds.

A sphere has escaped when it is out of the trap's reach at the end of a step, or was in between: a Brownian path that
starts the step at d₀ and ends it at d₁ inside a boundary has crossed it with probability exp(−2 d₀ d₁/s²), s² the
variance of the step's displacement along one axis (Gobet 2000, doi:10.1016/S0304-4149(99)00109-X; the boundary counts
as flat). Without this, escapes come late by O(√dt).
"""

import warp as wp

from otwarp.kernels.features import Features
from otwarp.kernels.random import Stream, noise_words, uniform
from otwarp.kernels.roots import reciprocal_root, square_root
from otwarp.kernels.trap_wrench import anchor_of, trap_command_term
from otwarp.kernels.types import ControlData, ModelData, Pose, ReadoutData, StateData, world_row

NEAR = wp.constant(5.0)
"""Distance from the boundary, in standard deviations s of a step, beyond which no crossing is looked for: had both ends
been that far inside, one would happen with probability e⁻⁵⁰."""


@wp.func
def crossed(
    seed: wp.uint32, world: int, trap: int, step: wp.int64, reach: float, before2: float, after2: float, s2: float
) -> bool:
    """Whether the path of a step between two squared distances inside `reach` [µm] went out and came back."""
    per_s = reciprocal_root(s2)
    inside = 2.0 * (reach - square_root(before2)) * (reach - square_root(after2)) * per_s * per_s
    words = noise_words(seed, wp.static(wp.uint32(Stream.CROSSING)), step, world, trap)
    return uniform(words[0]) < wp.exp(-inside)


def escape_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, world, b, before, pose, step, time) -> leeway`: note the first step of a loss.

    `step` and `time` are those of the arrival at `pose`, from `before`. A focus with a speed limit counts as where it
    has come to, at both ends of the step. As long as no point of the body has moved by
    the leeway [µm], nothing can be lost.
    """
    trap_command = trap_command_term(f)

    @wp.func
    def distance2(model: ModelData, trap: int, command: wp.vec4, pose: Pose) -> float:
        """Squared distance of the held sphere from the equilibrium point [µm²]."""
        held = pose.position + wp.quat_rotate(pose.rotation, model.traps.held_offset[trap])
        return wp.length_sq(held - anchor_of(model, trap, command))

    @wp.func
    def note_escapes(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        world: int,
        b: int,
        before: Pose,
        pose: Pose,
        step: wp.int64,
        time: wp.float64,
    ) -> float:
        """Compare the held sphere's distance with the trap's reach; how much farther the body may go unwatched [µm]."""
        leeway = float(wp.inf)
        for trap in range(model.traps.axis.shape[0]):
            if model.traps.held_body[trap] == b and readout.escape_step[world, trap] < wp.int64(0):
                command = trap_command(model, control, state, world, trap, time)
                reach = model.traps.held_range[world_row(model.traps.held_range.shape[0], world), trap]
                after2 = distance2(model, trap, command, pose)
                near = reach
                # a dark trap holds nothing that could escape
                lost = command[3] > 0.0 and after2 > reach * reach
                if wp.static(f.brownian and f.crossings):
                    if command[3] > 0.0 and not lost:
                        s2 = spread2(model, world, trap)
                        near = wp.max(reach - NEAR * wp.sqrt(s2), 0.0)
                        start = trap_command(model, control, state, world, trap, time - model.time_step)
                        before2 = distance2(model, trap, start, before)
                        if wp.max(before2, after2) > near * near and before2 < reach * reach:
                            lost = crossed(
                                model.seed, world, trap, step - wp.int64(1), reach, before2, after2, s2
                            )  # fmt: skip
                if lost:
                    readout.escape_step[world, trap] = step
                elif command[3] > 0.0:
                    leeway = wp.min(leeway, near - wp.sqrt(after2))
                if wp.static(not f.still_traps):
                    leeway = 0.0
        return leeway

    return note_escapes


@wp.func
def spread2(model: ModelData, world: int, trap: int) -> float:
    """Variance of the thermal displacement of a held sphere along one axis in one step [µm²]."""
    viscosity = model.medium.viscosity[world_row(model.medium.viscosity.shape[0], world)]
    energy = model.medium.thermal_energy[world_row(model.medium.thermal_energy.shape[0], world)]
    return 2.0 * energy * model.traps.held_mobility[trap] / viscosity * wp.float32(model.time_step)
