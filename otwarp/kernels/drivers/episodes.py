"""Between launches: which worlds are in motion, which have come to their end, and which start anew."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import warp as wp

from otwarp.kernels.core.functions import compiled, function_from_text
from otwarp.kernels.core.periodic import kept_in_cell
from otwarp.kernels.core.rounding import PRECISION
from otwarp.kernels.core.types import ModelData, ReadoutData, StateData, WorldNow, WorldsData, world_row
from otwarp.kernels.core.worlds import living_world

FAULTY = wp.constant(-1)
"""Code of a world that ended because a body of it has a fault."""


@dataclass(frozen=True)
class WorldFunction:
    """A function of a world at a moment, with parameters: what ends its task, or a number that is read of it.

    Attributes:
        function: `(now: WorldNow, *parameters) -> bool`, or of a number `-> float`, as written.
        kinds: Types of its parameters: `float`, `int` or `wp.vec3`.
        whole: Values of the whole ones where kernels are compiled for them, () where they are read as the rest is.
    """

    function: Callable[..., Any]
    kinds: tuple[type, ...]
    whole: tuple[int, ...] = ()

    @property
    def width(self) -> int:
        """Numbers that its parameters are made of."""
        return sum(3 if kind is wp.vec3 else 1 for kind in self.kinds)


def parameters_from(function: WorldFunction, first: int) -> str:
    """The arguments after `now` of a call: what its row of numbers holds from column `first` on."""
    text, column, whole = "", first, iter(function.whole)
    for kind in function.kinds:
        if kind is int and function.whole:
            text += f", {next(whole)}"
            column += 1
        elif kind is wp.vec3:
            text += f", vec3(values[row, {column}], values[row, {column + 1}], values[row, {column + 2}])"
            column += 3
        else:
            text += f", {'int(' if kind is int else '('}values[row, {column}])"
            column += 1
    return text


def end_term(predicates: tuple[WorldFunction, ...]) -> wp.Function:
    """`(now, values) -> code`: 1 + the place of the first predicate that says so in a world, 0 while none does.

    `values` (1|W, P) are the parameters of all predicates, one after the other.
    """
    lines, first = [], 0
    for n, predicate in enumerate(predicates):
        call = f"end_{n}(now{parameters_from(predicate, first)})"
        lines.insert(0, f"    if {call}:\n        code = {n + 1}\n")
        first += predicate.width
    text = (
        "def end_of(now: WorldNow, values: Values) -> int:\n"
        '    """Code of the first end that a world has come to."""\n'
        f"    row = world_row(values.shape[0], now.world)\n    code = int(0)\n{''.join(lines)}    return code\n"
    )
    names: dict[str, Any] = {
        "WorldNow": WorldNow,
        "Values": wp.array2d(dtype=wp.float32),
        "vec3": wp.vec3,
        "world_row": world_row,
    }
    for n, predicate in enumerate(predicates):
        names[f"end_{n}"] = compiled(predicate.function, PRECISION, "end", (wp.bool, wp.int32), "bool")
    return wp.func(function_from_text("end_of", text, names))


@wp.kernel(enable_backward=False)
def list_living(model: ModelData):
    """Append each world in motion to the list, whose count must be 0; their order matters to no result."""
    world = wp.tid()
    if model.worlds[0].done[world] == 0:
        place = wp.atomic_add(model.worlds[0].count, 0, 1)
        model.worlds[0].living[place] = world


@wp.func
def turn_clock(worlds: WorldsData, world: int, steps: int) -> wp.int64:
    """Add the steps that a world has taken to its clock, and return what it shows."""
    step = worlds.step[world] + wp.int64(steps)
    worlds.step[world] = step
    return step


@wp.func
def end_code(readout: ReadoutData, world: int, found: int) -> int:
    """Why a world has ended: a fault of a body before all else, then the end that was `found`, 0 for none."""
    code = found
    for b in range(readout.fault.shape[1]):
        if readout.fault[world, b] != 0:
            code = FAULTY
    return code


@functools.lru_cache(maxsize=64)
def settle_kernel(predicates: tuple[WorldFunction, ...]) -> wp.Kernel:
    """Kernel over the places of the list: turn the clocks of the worlds in motion, and tell which have ended."""
    end_of = end_term(predicates)

    @wp.kernel(module="unique", enable_backward=False)
    def settle(
        model: ModelData, state: StateData, readout: ReadoutData, values: wp.array2d(dtype=wp.float32), steps: int
    ):
        """Add `steps` to the clock of each world in motion, and write why it has ended, if it has."""
        world = living_world(model, wp.tid())
        if world < 0:
            return
        # a list of all worlds may hold some that have ended before
        if model.worlds[0].done[world] != 0:
            return
        step = turn_clock(model.worlds[0], world, steps)
        time = wp.float32(wp.float64(step) * model.time_step)
        code = end_code(readout, world, end_of(WorldNow(world, step, time, state, readout), values))
        model.worlds[0].done[world] = code
        if code == 0:
            wp.atomic_add(model.worlds[0].count, 1, 1)

    return settle


@wp.kernel(enable_backward=False)
def outcomes(
    done: wp.array(dtype=wp.int32), step: wp.array(dtype=wp.int64), fault: wp.array2d(dtype=wp.int32),
    fault_step: wp.array2d(dtype=wp.int64), escape_step: wp.array2d(dtype=wp.int64), escaped: int,
    time_step: wp.float64, code: wp.array(dtype=wp.int8), time: wp.array(dtype=wp.float64),
):  # fmt: skip
    """Why each world ended, and when [s]: a fault or `escaped` (0: nothing), a lost sphere, at the very step.

    Another end that was found at the same look may have come after the sphere was lost.
    """
    world = wp.tid()
    found, when = int(done[world]), wp.int64(step[world])
    if found == FAULTY:
        for b in range(fault.shape[1]):
            if fault[world, b] != 0:
                when = wp.min(when, fault_step[world, b])
    if escaped > 0:
        first = wp.int64(-1)
        for t in range(escape_step.shape[1]):
            at = wp.int64(escape_step[world, t])
            if at >= wp.int64(0) and (first < wp.int64(0) or at < first):
                first = at
        if first >= wp.int64(0) and (found != FAULTY or first < when):
            found, when = escaped, first
    code[world] = wp.int8(found)
    time[world] = wp.float64(when) * time_step


@wp.kernel(enable_backward=False)
def flag_worlds(chosen: wp.array(dtype=wp.bool), flags: wp.array(dtype=wp.int32)):
    """1 for each chosen world, else 0."""
    world = wp.tid()
    flags[world] = wp.where(chosen[world], 1, 0)


@wp.func
def restart_world(
    model: ModelData, state: StateData, readout: ReadoutData, start: StateData, world: int, number: wp.uint32
):  # fmt: skip
    """Start a world anew in a trial: pose from `start` (1|W), nothing measured, its clock at 0."""
    for b in range(state.position.shape[1]):
        place = start.position[world_row(start.position.shape[0], world), b]
        if state.image.shape[1] > 0:
            state.image[world, b] = start.image[0, b]
            place = kept_in_cell(model, state, world, b, place)
        state.position[world, b] = place
        readout.fault[world, b] = 0
        readout.fault_step[world, b] = wp.int64(0)
    for b in range(state.orientation.shape[1]):
        state.orientation[world, b] = start.orientation[world_row(start.orientation.shape[0], world), b]
    for t in range(state.trap_position.shape[1]):
        state.trap_position[world, t] = start.trap_position[world_row(start.trap_position.shape[0], world), t]
    for b in range(readout.entries.shape[1]):
        readout.entries[world, b] = 0
    for t in range(readout.escape_step.shape[1]):
        readout.escape_step[world, t] = wp.int64(-1)
    for b in range(readout.contact_force.shape[1]):
        readout.contact_force[world, b] = wp.vec3(0.0)
        readout.contact_load[world, b] = float(0.0)
    model.worlds[0].number[world] = number
    model.worlds[0].step[world] = wp.int64(0)
    model.worlds[0].done[world] = 0


@wp.kernel(enable_backward=False)
def restart(
    model: ModelData, state: StateData, readout: ReadoutData, chosen: wp.array(dtype=wp.int32), start: StateData,
    number: wp.array(dtype=wp.uint32), stride: wp.uint32,
):  # fmt: skip
    """Start each chosen world anew.

    The trial is `number` (W), or where that is empty, the last one + `stride`.
    """
    world = wp.tid()
    if chosen[world] == 0:
        return
    next_number = model.worlds[0].number[world] + stride
    if number.shape[0] > 0:
        next_number = number[world]
    restart_world(model, state, readout, start, world, next_number)
