"""Between launches: the order parameter of each world in motion, and which interface it has come to."""

import functools
from typing import Any

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.functions import compiled, function_from_text
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.rounding import PRECISION
from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData, WorldNow, world_row
from otwarp.kernels.core.worlds import living_world
from otwarp.kernels.drivers.episodes import WorldFunction, parameters_from
from otwarp.kernels.optics.readout import sphere_position_term
from otwarp.kernels.optics.trap_command import anchor_of, trap_command_term

RETURNED = wp.constant(2)
"""Code of a world whose order parameter is below its lower interface."""

ADVANCED = wp.constant(3)
"""Code of a world whose order parameter has come to its upper interface."""

NO_NUMBER = wp.constant(4)
"""Code of a world whose order parameter is NaN."""


def distance_term(f: Features) -> wp.Function:
    """`(model, control, state, world, step, only, relative) -> float`: how far held spheres are from their traps."""
    trap_command, sphere_position = trap_command_term(f), sphere_position_term(f)

    @wp.func
    def distance(
        model: ModelData, control: ControlData, state: StateData, world: int, step: wp.int64, only: int, relative: float
    ) -> float:
        """Largest distance of a held sphere from its trap's equilibrium point [µm], of trap `only` unless that is < 0.

        Where `relative` is not 0, in units of the distance at which it has escaped.
        """
        largest = float(wp.nan)
        time = wp.float64(step) * model.time_step
        for trap in range(model.traps.axis.shape[0]):
            b = model.traps.held_body[trap]
            if b >= 0 and (only < 0 or only == trap):
                anchor = anchor_of(model, trap, trap_command(model, control, state, world, trap, time))
                away = sphere_position(model, state, world, b, model.traps.held_offset[trap]) - anchor
                if wp.static(f.periodic):
                    away = nearest(model.period, away)
                far = wp.length(away)
                if relative != 0.0:
                    far = far / model.traps.held_range[world_row(model.traps.held_range.shape[0], world), trap]
                largest = wp.where(wp.isnan(largest), far, wp.max(largest, far))
        return largest

    return distance


def order_term(function: WorldFunction) -> wp.Function:
    """`(now, values) -> float`: a function of a world at a moment, with its parameters from a row of `values`."""
    text = (
        "def order_of(now: WorldNow, values: Values) -> float:\n"
        '    """The order parameter of a world."""\n'
        "    row = world_row(values.shape[0], now.world)\n"
        f"    return order(now{parameters_from(function, 0)})\n"
    )
    names: dict[str, Any] = {
        "WorldNow": WorldNow,
        "Values": wp.array2d(dtype=wp.float32),
        "vec3": wp.vec3,
        "float": wp.float32,
        "world_row": world_row,
        "order": compiled(function.function, PRECISION),
    }
    return wp.func(function_from_text("order_of", text, names))


@functools.lru_cache(maxsize=64)
def interface_kernel(f: Features | None, function: WorldFunction | None) -> wp.Kernel:
    """Kernel over the places of the list of worlds in motion: read the order parameter, and end who is at an interface.

    Args:
        f: Features of the scene for the distance of held spheres from their traps; None for another function.
        function: `(now: WorldNow, *parameters) -> float`; None for the distance.
    """
    distance = None if f is None else distance_term(f)
    order_of = None if function is None else order_term(function)

    @wp.kernel(module="unique", enable_backward=False)
    def look(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData,
        values: wp.array2d(dtype=wp.float32), low: wp.array(dtype=wp.float32), high: wp.array(dtype=wp.float32),
        order: wp.array(dtype=wp.float32), peak: wp.array(dtype=wp.float32),
    ):  # fmt: skip
        """Write the order parameter of each world in motion, the largest so far, and its code in `done`.

        Worlds that have ended otherwise keep both; `low` and `high` (worlds) are their interfaces.
        """
        world = living_world(model, wp.tid())
        if world < 0:
            return
        if model.worlds[0].done[world] != 0:
            return
        step = model.worlds[0].step[world]
        value = float(0.0)
        if wp.static(function is None):
            only, relative = int(values[0, 0]), values[0, 1]
            value = distance(model, control, state, world, step, only, relative)
        else:
            time = wp.float32(wp.float64(step) * model.time_step)
            value = order_of(WorldNow(world, step, time, state, readout), values)
        order[world] = value
        peak[world] = wp.max(peak[world], value)
        if wp.isnan(value):
            model.worlds[0].done[world] = NO_NUMBER
        elif value >= high[world]:
            model.worlds[0].done[world] = ADVANCED
        elif value < low[world]:
            model.worlds[0].done[world] = RETURNED

    return look
