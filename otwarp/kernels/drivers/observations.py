"""Between launches: numbers that are read of each world in motion, and what of their course is kept."""

import functools
from typing import Any

import warp as wp

from otwarp.kernels.core.functions import compiled, function_from_text
from otwarp.kernels.core.types import ModelData, ReadoutData, StateData, WorldNow, world_row
from otwarp.kernels.core.worlds import living_world
from otwarp.kernels.drivers.episodes import PRECISION, WorldFunction, parameters_from

REDUCTIONS = ("last", "largest", "least", "mean", "integral")
"""What of a number's course may be kept."""

_KEEP = {
    "last": "value",
    "largest": "wp.where(first, value, wp.max(kept[world, {n}], value))",
    "least": "wp.where(first, value, wp.min(kept[world, {n}], value))",
    "mean": "wp.where(first, value, kept[world, {n}] + (value - kept[world, {n}]) / float(count))",
    "integral": "wp.where(first, span * value, kept[world, {n}] + span * value)",
}


@functools.lru_cache(maxsize=64)
def observe_kernel(functions: tuple[WorldFunction, ...], reductions: tuple[str, ...]) -> wp.Kernel:
    """Kernel over the places of the list of worlds in motion: read numbers, and keep what is wanted of each.

    Args:
        functions: Functions `(now: WorldNow, *parameters) -> float`.
        reductions: For each, one of `REDUCTIONS`.
    """
    lines, first = [], 0
    for n, (function, how) in enumerate(zip(functions, reductions, strict=True)):
        keep = _KEEP[how].format(n=n)
        lines.append(
            f"    value = observed_{n}(now{parameters_from(function, first)})\n    kept[world, {n}] = {keep}\n"
        )
        first += function.width
    text = (
        "def keep_all(now: WorldNow, values: Values, kept: Values, count: int, span: float):\n"
        '    """Read all numbers of a world and keep what is wanted of them."""\n'
        "    world = now.world\n    row = world_row(values.shape[0], world)\n    first = count == 1\n" + "".join(lines)
    )
    names: dict[str, Any] = {
        "WorldNow": WorldNow,
        "Values": wp.array2d(dtype=wp.float32),
        "vec3": wp.vec3,
        "wp": wp,
        "world_row": world_row,
    }
    for n, function in enumerate(functions):
        names[f"observed_{n}"] = compiled(function.function, PRECISION, "observable", (wp.float32,), "float")
    keep_all = wp.func(function_from_text("keep_all", text, names))

    @wp.kernel(module="unique", enable_backward=False)
    def observe(
        model: ModelData, state: StateData, readout: ReadoutData, values: wp.array2d(dtype=wp.float32),
        kept: wp.array2d(dtype=wp.float32), counts: wp.array(dtype=int), steps: int,
    ):  # fmt: skip
        """After `steps` steps: read the worlds that took them; `counts` (worlds) is how often each was read."""
        world = living_world(model, wp.tid())
        if world < 0:
            return
        count = counts[world] + 1
        counts[world] = count
        step = model.worlds[0].step[world]
        time = wp.float32(wp.float64(step) * model.time_step)
        span = wp.float32(wp.float64(steps) * model.time_step)
        keep_all(WorldNow(world, step, time, state, readout), values, kept, count, span)

    return observe
