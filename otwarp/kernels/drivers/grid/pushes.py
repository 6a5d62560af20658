"""What pairs of lone spheres exert on each other, where a CPU lists each pair once: sums of whole numbers.

A pair is found with its first sphere and pushes both, so that a sphere is pushed in the order of slots, which changes
whenever lists are made. Sums of whole numbers do not depend on their order: the bits are those of any other.
"""

import warp as wp

from otwarp.kernels.core.faults import Fault, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData, ReadoutData, StateData
from otwarp.kernels.drivers.grid.data import GridData
from otwarp.kernels.drivers.grid.neighbours import FULL, next_in_cells_term
from otwarp.kernels.drivers.grid.slot_lists import touching_pairs_term
from otwarp.kernels.drivers.grid.soft_forces import SoftForce, soft_pair_term

QUANTA = wp.constant(wp.float64(2.0**34))
"""Of force in one pN: a quantum is less than the rounding of a thermal force in float32."""

MOST_LOAD = wp.constant(2.0**24)
"""Of a contact [pN], 17 µN: of 32 such ones the sum still has 64 bits."""


@wp.func
def quanta(force: wp.vec3, load: float) -> wp.vec4l:
    """Force and load [pN] in whole quanta of 2⁻³⁴ pN."""
    x = wp.float64(force[0]) * QUANTA
    y = wp.float64(force[1]) * QUANTA
    z = wp.float64(force[2]) * QUANTA
    return wp.vec4l(wp.int64(x), wp.int64(y), wp.int64(z), wp.int64(wp.float64(load) * QUANTA))


@wp.func
def of_quanta(sum: wp.int64) -> float:
    """A sum of quanta in pN."""
    return float(wp.float64(sum) / QUANTA)


def listed_once_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world, i, a, here, step) -> SoftForce` that `push_pairs_term` has summed."""

    @wp.func
    def listed_once(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, i: int, a: int,
        here: wp.vec4, step: wp.int64,
    ) -> SoftForce:  # fmt: skip
        """Force and load [pN] on slot i, whose sum begins anew."""
        sum = grid.push[i]
        grid.push[i] = wp.vec4l()
        return SoftForce(wp.vec3(of_quanta(sum[0]), of_quanta(sum[1]), of_quanta(sum[2])), of_quanta(sum[3]))

    return listed_once


def push_pairs_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world, first, count, chosen)`: sum what the pairs of `count` slots exert."""
    soft_pair, next_in_cells = soft_pair_term(f), next_in_cells_term(f)
    touching_pairs = touching_pairs_term(f)

    @wp.func
    def push_pair(model: ModelData, readout: ReadoutData, grid: GridData, world: int, i: int, j: int, step: wp.int64):
        """Add what slots i and j exert on each other to the sums of both."""
        order, place = grid.turn[0], grid.row[0]
        one = soft_pair(model, readout, grid, world, grid.order[order, i], grid.place[place, i], j, step)
        if readout.fault_count[0] != 0:
            # what lies too deep in the other is a fault of both
            soft_pair(model, readout, grid, world, grid.order[order, j], grid.place[place, j], i, step)
        if one.load < MOST_LOAD:
            grid.push[i] += quanta(one.force, one.load)
            grid.push[j] += quanta(-one.force, one.load)
        else:
            raise_fault(readout, world, grid.order[order, i], wp.static(int(Fault.NON_FINITE)), step)
            raise_fault(readout, world, grid.order[order, j], wp.static(int(Fault.NON_FINITE)), step)

    @wp.func
    def push_pairs(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, first: int, count: int,
        chosen: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        """Pairs whose first slot is one of first … first + count − 1; the other comes later."""
        step = grid.clock[0]
        for t in range(touching_pairs(model, grid, first, count, chosen)):
            push_pair(model, readout, grid, world, chosen[2 * t], chosen[2 * t + 1], step)
        if grid.near.full[world] == 0:
            return
        for i in range(first, first + count):
            if grid.near.count[i] == FULL:
                j = next_in_cells(model, state, grid, world, i, -1)
                while j >= 0:
                    if j > i:
                        push_pair(model, readout, grid, world, i, j, step)
                    j = next_in_cells(model, state, grid, world, i, j)

    return push_pairs
