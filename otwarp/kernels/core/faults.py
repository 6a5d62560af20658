"""Codes by which the device tells the host that a body's state is no longer physical."""

import enum

import warp as wp

from otwarp.kernels.core.types import ReadoutData


class Fault(enum.IntEnum):
    """Why a body stopped: codes of `Readout.fault`."""

    NONE = 0
    NON_FINITE = 1
    OVERLAP = 2
    OVERFLOW = 3
    UNSETTLED = 4


FAULT_TEXT = {
    Fault.NON_FINITE: "the state became non-finite or ran beyond 1e9 µm (time step too large, or forces out of range)",
    Fault.OVERLAP: "spheres overlap by more than half the smaller radius (time step too large, or driven too hard)",
    Fault.OVERFLOW: "more contacts at once than the solver holds",
    Fault.UNSETTLED: "the contact forces of one step were not found (time step too large for so many stiff contacts)",
}

OVERLAP_LIMIT = wp.constant(0.5)
"""Overlap, relative to the smaller radius, above which Hertz contact means nothing and the run stops."""


FARTHEST = wp.constant(1.0e9)
"""Sum of the coordinates' sizes [µm] from which on a body has been thrown out: squares of distances would soon
overflow, and forces read 0."""


@wp.func
def finite(v: wp.vec3) -> bool:
    """Whether all components are finite and of a size that a scene can have; false for nan, which compares so."""
    return wp.abs(v[0]) + wp.abs(v[1]) + wp.abs(v[2]) < FARTHEST


@wp.func
def raise_fault(readout: ReadoutData, world: int, body: int, code: int, step: wp.int64):
    """Record the first fault of a body, and that there is one: a flag, as no count would be exact between threads."""
    if readout.fault[world, body] == 0:
        readout.fault[world, body] = code
        readout.fault_step[world, body] = step
        readout.fault_count[0] = 1
