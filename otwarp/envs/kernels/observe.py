"""A kernel that observes worlds which something else steps and judges."""

import functools
from typing import Any

import warp as wp

from otwarp.envs.kernels.geometry import find_gaps
from otwarp.envs.kernels.judge import NumberData, Reading, columns_of, seen_term
from otwarp.envs.kernels.rows import store_row_term
from otwarp.envs.kernels.specialise import called_for
from otwarp.envs.kernels.types import EpisodeData, PlaceData, TaskNow
from otwarp.kernels.core.features import CPU_FLAGS
from otwarp.kernels.core.types import ReadoutData, StateData


@functools.lru_cache(maxsize=64)
def observe_kernel(readings: tuple[Reading, ...], shapes: tuple[str, ...], gaps_seen: bool) -> Any:
    """Kernel over worlds that writes what is seen of each; arguments as those of `judge_kernels`."""
    see, store_seen = seen_term(readings), store_row_term(columns_of(readings))
    gaps = called_for(find_gaps, shapes)

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def observe(state: StateData, readout: ReadoutData, place: PlaceData, numbers: NumberData, period: int,
                episode: EpisodeData, seen: wp.array2d(dtype=wp.float32)):  # fmt: skip
        """What is seen of each world so many periods after its start."""
        world = wp.tid()
        now = TaskNow(world, period, float(period) * place.period, state, readout, place, episode)
        if wp.static(gaps_seen):
            gaps(now)
        store_seen(seen, world, see(now, numbers.seen, numbers.scale))

    return observe
