"""The structs of simulated operators. Hands are in the device's frame, in m, s, N; the scene is in µm, s, pN.

Shapes: W worlds, H hands, T traps, B bodies, R samples of a ring, K samples of a path.
"""

import warp as wp

PLANNED = wp.constant(4)
"""Submovements along the path that may be under way at once."""
CORRECTED = wp.constant(8)
"""Corrections that are under way, or not seen yet."""
AT_A_GLANCE = wp.constant(5)
"""Moments ahead at which an operator compares going on with waiting."""

NOTHING, YIELDS, RESPONDS = 0, 1, 2
"""What a force does to an operator: nothing, it moves the arm, it moves the arm and slows the hand."""


@wp.struct
class Person:
    """One simulated operator; see `population.toml` for what the numbers mean."""

    number: wp.uint32  # key of its random numbers: the same in all conditions
    feels: wp.int32  # NOTHING, YIELDS or RESPONDS
    visual_delay: wp.int32  # [periods]
    response_delay: wp.int32  # [periods]
    correction_interval: wp.int32  # [periods]
    interval: wp.float64  # [s]
    duration: wp.float64  # [s]
    lead: wp.float64  # how far ahead of now a submovement aims [s]
    horizon: wp.float64  # how far ahead obstacles are looked at [s]
    pace: wp.float64  # [1]
    lag: wp.float64  # of the left hand [s]
    correction: wp.float64  # part of an error that one submovement takes back [1]
    noise: wp.float64  # [1]
    common: wp.float64  # part of the noise's variance that both hands share [1]
    threshold: wp.float64  # smallest error that is corrected, at the hand [m]
    clearance: wp.float64  # [µm]
    lag_threshold: wp.float64  # [µm]
    difference: wp.float64  # smallest change of a force that is felt, over the force [1]
    onset: wp.float64  # force where slowing begins [N]
    span: wp.float64  # of onsets, from there to a standstill [1]
    stiffness: wp.float64  # [N/m]
    turn: wp.vec4d  # rows of the matrix that takes deviation [m] and velocity [m/s] over one period


@wp.struct
class TaskData:
    """What all operators are asked to do."""

    seed: wp.uint32
    period: wp.float64  # of the servo [s]
    spacing: wp.float64  # of the samples of paths [s]
    end: wp.float64  # of the paths [s]
    gain: wp.float64  # µm of traps per m of hand
    lagging: wp.int32  # the hand that is behind, -1 for none
    path: wp.array2d(dtype=wp.vec3d)  # (H, K) way of each hand from its start, device frame [m]
    axes: wp.array(dtype=wp.mat33d)  # (H) A: scene = A device
    start: wp.array(dtype=wp.vec3d)  # (T) foci at the start [µm]
    hand_of: wp.array(dtype=wp.int32)  # (T) hand that moves each trap, -1 for none
    carried: wp.array(dtype=wp.vec2i)  # bodies that must not be run into, and the hand that each goes with
    place: wp.array(dtype=wp.vec3)  # (B) where bodies start [µm]
    turned: wp.array(dtype=wp.quat)  # (B) how they lie there
    moving: wp.array(dtype=wp.int32)  # obstacles that move


@wp.struct
class SightData:
    """What operators see, as of the newest picture."""

    error: wp.array2d(dtype=wp.vec3d)  # (W, H) how far a hand's traps are from where they were meant to be [m]
    lag: wp.array(dtype=wp.float64)  # (W) largest distance of a held sphere from its trap [µm]


@wp.struct
class MindData:
    """What operators remember and do; all zero before the first period."""

    tick: wp.array(dtype=wp.int32)  # (W) periods since the start
    clock: wp.array(dtype=wp.float64)  # (W) time of the planned movement, which slows with the response [s]
    next_plan: wp.array(dtype=wp.float64)  # (W) when the next submovement begins, by that clock [s]
    plans: wp.array(dtype=wp.int32)  # (W) submovements so far
    corrections: wp.array(dtype=wp.int32)  # (W) corrections so far
    progress: wp.array(dtype=wp.float64)  # (W) where on the path, in its author's time [s]
    aim: wp.array(dtype=wp.float64)  # (W) where on the path the last submovement goes [s]
    goes: wp.array(dtype=wp.float64)  # (W) 1, or 0 while waiting for an obstacle
    noticed: wp.array(dtype=wp.float64)  # (W) force that was last felt to have changed [N]
    began: wp.array2d(dtype=wp.float64)  # (W, PLANNED) when submovements began, by the clock [s]
    corrected: wp.array2d(dtype=wp.float64)  # (W, CORRECTED) when corrections began [s]
    meant: wp.array3d(dtype=wp.vec3d)  # (W, H, PLANNED) submovements as meant [m]
    made: wp.array3d(dtype=wp.vec3d)  # (W, H, PLANNED) and as made
    sent: wp.array3d(dtype=wp.vec3d)  # (W, H, CORRECTED) corrections as meant [m]
    given: wp.array3d(dtype=wp.vec3d)  # (W, H, CORRECTED) and as made
    meant_before: wp.array2d(dtype=wp.vec3d)  # (W, H) sum of those that are over
    made_before: wp.array2d(dtype=wp.vec3d)  # (W, H) the same of what was made, corrections included
    aimed: wp.array2d(dtype=wp.vec3d)  # (W, H) where the path is at the last aim [m]
    aimed_late: wp.array2d(dtype=wp.vec3d)  # (W, H) and for the hand that is behind
    wanted: wp.array2d(dtype=wp.vec3d)  # (W, H) where the hand is meant to be now [m]
    deviation: wp.array2d(dtype=wp.vec3d)  # (W, H) of the arm from its plan [m]
    velocity: wp.array2d(dtype=wp.vec3d)  # (W, H) of that deviation [m/s]
    position: wp.array2d(dtype=wp.vec3d)  # (W, H) of the hand [m]
    errors: wp.array3d(dtype=wp.vec3d)  # (R, W, H) seen errors
    lags: wp.array2d(dtype=wp.float64)  # (R, W) seen lags [µm]
    forces: wp.array2d(dtype=wp.float64)  # (R, W) felt forces [N]


@wp.struct
class AccountData:
    """What is kept of the trials, (W) each; sums are over servo periods."""

    counted: wp.array(dtype=wp.int32)  # periods
    contact: wp.array(dtype=wp.float64)  # sum of the contact force on the cell [pN]
    contact_peak: wp.array(dtype=wp.float64)  # [pN]
    contact_above: wp.array(dtype=wp.int32)  # periods above the warning
    distance: wp.array(dtype=wp.float64)  # sum of the mean distance of held spheres from their traps [µm]
    distance_peak: wp.array(dtype=wp.float64)  # of any of them [µm]
    distance_above: wp.array(dtype=wp.int32)  # periods above the warning
    force: wp.array(dtype=wp.float64)  # sum of the mean force on a hand [N]
    force_peak: wp.array(dtype=wp.float64)  # on any hand [N]
    work: wp.array(dtype=wp.float64)  # of the device on the hands [J]
    work_peak: wp.array(dtype=wp.float64)  # most that they had been given at any time [J]
    waited: wp.array(dtype=wp.int32)  # periods of waiting for obstacles, or for what is left behind
    slowed: wp.array(dtype=wp.int32)  # periods slowed by the response to force
