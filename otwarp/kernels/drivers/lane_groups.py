"""What the lanes of a CPU have in common: see `otwarp.kernels.drivers.lanes`."""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.step_constants import BeadConstants
from otwarp.kernels.cpu.noise_block import BLOCK
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.kernels.optics.escapes import EscapeMonitor

GROUP = 16
"""Bodies of one thread: enough to fill a processor's pipelines and the widest registers, few enough for what they need
to stay near it."""


@wp.struct
class BeadLane:
    """A lone sphere on its way.

    `until` is the step of the launch at which it stops; with episodes, `start` is the step of its world at which the
    launch begins.
    """

    position: wp.vec3
    until: wp.int32
    start: wp.int64
    world: wp.int32
    bead: BeadConstants
    first: EscapeMonitor
    second: EscapeMonitor


def threads_for(bodies: int) -> int:
    """Threads to launch for so many bodies in all worlds."""
    return -(-bodies // GROUP)


def fresh_steps(f: Features) -> int:
    """Steps that a block of noise lasts."""
    return BLOCK - INTEGRATORS[f.integrator].noise_ahead


def draws_blocks(f: Features) -> bool:
    """Whether noise comes in blocks: near walls it needs more deviates, and draws them by itself."""
    return f.brownian and not f.walls


def view_term(kind: type) -> wp.Function:
    """`(room) -> address` of a local array of structs.

    An array made anew from the address is one whose shape the compiler knows for good, while it must believe that
    whatever fills a block of noise could overwrite the shape of the local array itself.
    """

    @wp.func_native("""
        return (wp::uint64)room.data;
    """)
    def address(room: wp.array(dtype=kind)) -> wp.uint64:
        """Address of the first struct of a local array."""
        ...

    return address


bead_lanes_at = view_term(BeadLane)


@wp.func_native("""
    __builtin_assume(i >= 0);
    return i;
""")
def from_start(i: int) -> int:
    """An index that does not count from the end of an array, which the compiler need not check then."""
    ...
