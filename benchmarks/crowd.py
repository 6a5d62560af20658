"""Many soft Brownian spheres that touch: speed against their number, and what every kernel of a step takes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from benchmarks.report import Section, command, positive
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.speed.many_body import FRACTION, ManySpheres
from otwarp.bench.timing import Quartiles, calls_for, elapsed
from otwarp.device import pick_device
from otwarp.simulation.drivers.grid_stepper import GridStepper

SIZES = {"cpu": (10_000, 100_000, 1_000_000), "cuda": (10_000, 100_000, 1_000_000, 10_000_000)}
WARM = 60
"""Steps before the first sample: lists and clocks, not equilibrium."""


def measured(crowd: ManySpheres, rounds: int, seconds: float) -> dict[str, Any]:
    """Speed, and how often lists were made."""
    near = crowd.stepper.scratch.near
    crowd.step(WARM)
    steps = calls_for(crowd.step, crowd.device, seconds)
    first, begun = int(near.builds.numpy()[0]), crowd.state.step
    times = [elapsed(partial(crowd.step, steps), crowd.device).on(crowd.device) for _ in range(rounds)]
    made = int(near.builds.numpy()[0]) - first
    if int(crowd.readout.fault_count.numpy()[0]):
        raise RuntimeError("the crowd has a fault: the measured steps are not of the workload")
    return {
        "count": crowd.count,
        "steps_per_sample": steps,
        "ns": Quartiles.of([1e9 * t / (steps * crowd.count) for t in times]),
        "steps_per_list": (crowd.state.step - begun) / max(made, 1),
        # a CPU lists each pair once
        "neighbours": float(np.maximum(near.count.numpy(), 0).mean()) * (2.0 if len(near.begin) else 1.0),
        "touching": float((crowd.readout.contact_load.numpy() > 0.0).mean()),
    }


@contextmanager
def timed_launches(stepper: GridStepper, found: dict[str, list[float]]):
    """Record the processor time of every launch of a stepper on the CPU [s]."""
    launch, sort = stepper._launch, wp.utils.radix_sort_pairs

    def timed(work: Any, name: str, *inputs: Any) -> None:
        begun = time.process_time()
        work(*inputs)
        found.setdefault(name, []).append(time.process_time() - begun)

    stepper._launch = lambda kernel, *inputs: timed(launch, kernel.key, kernel, *inputs)  # type: ignore[method-assign]
    wp.utils.radix_sort_pairs = lambda *inputs: timed(sort, "radix sort", *inputs)
    try:
        yield
    finally:
        del stepper._launch  # type: ignore[attr-defined]
        wp.utils.radix_sort_pairs = sort


def kernel_times(crowd: ManySpheres, steps: int) -> dict[str, dict[str, float]]:
    """Per kernel: launches per step, and ns per particle of one launch; steps are taken one launch at a time."""
    found: dict[str, list[float]] = {}
    stepper = crowd.stepper
    crowd.step(1)  # so that the clock of the grid is where the state is
    if crowd.device.is_cpu:
        with timed_launches(stepper, found):
            for _ in range(steps):
                stepper._one_step()
    else:
        with wp.ScopedTimer("step", print=False, synchronize=True, cuda_filter=wp.TIMING_ALL) as timer:
            for _ in range(steps):
                stepper._one_step()
        for event in timer.timing_results:
            found.setdefault(event.name.removeprefix("forward kernel "), []).append(1e-3 * event.elapsed)
    crowd.stepper.place()
    return {
        name.split("__")[-1]: {
            "launches_per_step": len(times) / steps,
            "ns": 1e9 * float(np.median(times)) / crowd.count,
        }
        for name, times in found.items()
    }


@wp.kernel(enable_backward=False)
def list_by_hash_grid(
    table: wp.uint64, place: wp.array(dtype=wp.vec3), far: float, count: wp.array(dtype=wp.int32),
    neighbour: wp.array(dtype=wp.int32), width: int, size: int,
):  # fmt: skip
    """Neighbours of `size` points by Warp's hash grid, unsorted, as a measure of the other way."""
    _, share = wp.tid()  # pyright: ignore[reportAssignmentType]
    for k in range(share * size, wp.min((share + 1) * size, count.shape[0])):
        i = wp.hash_grid_point_id(table, k)
        found = int(0)  # noqa: RUF046, UP018 -- Warp wants to know that it changes
        for j in wp.hash_grid_query(table, place[i], far):
            if j != i and wp.length_sq(place[i] - place[j]) < far * far and found < width:
                neighbour[i * width + found] = j
                found += 1
        count[i] = found


def hash_grid_times(crowd: ManySpheres, repeats: int) -> dict[str, float]:
    """What lists by `wp.HashGrid` take [ns per particle]: building it, and one query of every sphere."""
    device, near = crowd.device, crowd.stepper.scratch.near
    cells = int(np.clip(2 ** np.ceil(np.log2((2.0 * crowd.count) ** (1.0 / 3.0))), 4, 256))
    table = wp.HashGrid(cells, cells, cells, device=device)
    place = crowd.state.position.reshape(crowd.count)
    count = wp.zeros(crowd.count, dtype=wp.int32, device=device)
    neighbour = wp.zeros(crowd.count * 24, dtype=wp.int32, device=device)
    size = crowd.count if device.is_cpu else 1
    inputs = [table.id, place, float(near.edge[0]), count, neighbour, 24, size]

    def build() -> None:
        table.build(place, near.edge[0])

    def query() -> None:
        wp.launch(list_by_hash_grid, dim=(1, crowd.count // size), inputs=inputs, device=device)

    out = {}
    for name, work in (("build", build), ("query", query)):
        work()
        times = [elapsed(work, device).on(device) for _ in range(repeats)]
        out[name] = 1e9 * float(np.median(times)) / crowd.count
    return out


def own_list_times(crowd: ManySpheres, repeats: int) -> float:
    """What making new lists takes [ns per particle], all its kernels."""
    times = [elapsed(crowd.stepper._make_lists, crowd.device).on(crowd.device) for _ in range(repeats)]
    return 1e9 * float(np.median(times)) / crowd.count


def speed_table(found: Sequence[dict[str, Any]]) -> Table:
    """Speed against number."""
    rows = [
        (
            f"{one['count']:.0e}" + (", `fast_math`" if one["fast_math"] else ""),
            one["ns"].text(),
            f"{1e9 / one['ns'].median:.3g}",
            f"{one['steps_per_list']:.1f}",
            f"{one['neighbours']:.2f}",
            f"{100.0 * one['touching']:.1f} %",
        )
        for one in found
    ]
    return Table(
        title=f"Soft Brownian spheres at volume fraction {FRACTION}",
        head=("spheres", "ns/particle-step", "particle-steps/s", "steps per list", "neighbours", "touching"),
        rows=rows,
        note="Listed neighbours are those within the skin; touching are those that feel a force.",
    )


def kernel_table(count: int, kernels: dict[str, dict[str, float]]) -> Table:
    """One step, kernel by kernel."""
    return Table(
        title=f"One step of {count:.0e} spheres, kernel by kernel",
        head=("kernel", "launches per step", "ns per particle and launch", "ns per particle and step"),
        rows=[
            (n, f"{k['launches_per_step']:.3g}", f"{k['ns']:.3g}", f"{k['launches_per_step'] * k['ns']:.3g}")
            for n, k in kernels.items()
        ],
    )


def list_table(own: float, other: dict[str, float]) -> Table:
    """Two ways to make neighbour lists."""
    both = other["build"] + other["query"]
    return Table(
        title="Neighbour lists [ns per particle]",
        head=("way", "cells", "lists", "both"),
        rows=[
            ("cells sorted, lists that ascend, on a CPU of each pair once", "", "", f"{own:.3g}"),
            ("`wp.HashGrid`, lists in no order", f"{other['build']:.3g}", f"{other['query']:.3g}", f"{both:.3g}"),
        ],
    )


def measure(
    device: str = "cpu",
    *,
    sizes: Sequence[int] = (),
    profiled: int | None = None,
    rounds: int = 5,
    seconds: float = 1.0,
) -> Section:
    """Speed at all sizes; kernel by kernel at `profiled`: if None a million on CUDA, a hundred thousand on the CPU."""
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    found = [
        measured(ManySpheres(count, place, fast_math=fast_math), rounds, seconds) | {"fast_math": fast_math}
        # approximate instructions change nothing but the noise's functions on a CPU
        for fast_math in ((False,) if place.is_cpu else (False, True))
        for count in sizes or SIZES[kind]
    ]
    crowd = ManySpheres(profiled or (100_000 if place.is_cpu else 1_000_000), place)
    crowd.step(WARM)
    kernels = kernel_times(crowd, 48)
    own, other = own_list_times(crowd, 5), hash_grid_times(crowd, 5)
    data = {
        "crowds": [{k: vars(v) if isinstance(v, Quartiles) else v for k, v in one.items()} for one in found],
        "kernels": kernels,
        "lists": {"own": own, "hash_grid": other},
    }
    tables = [speed_table(found), kernel_table(crowd.count, kernels), list_table(own, other)]
    return Section(name="crowd", kind=kind, machine=Machine.look(place), tables=tables, data=data)


if __name__ == "__main__":
    command(
        measure,
        "Many soft Brownian spheres that touch.",
        rounds=5,
        sizes={"type": positive, "nargs": "+", "default": (), "help": "numbers of spheres"},
        profiled={"type": positive, "help": "number of spheres timed kernel by kernel"},
    )
