"""Exact forces per second, of the float64 kernel and of NumPy: `python -m benchmarks.exact_speed --device cuda:0`.

Needs Warp, NumPy and SciPy alone, and touches no device but the one asked for.
"""

from __future__ import annotations

import argparse
import os

# before NumPy loads its BLAS: threads that wait for each other would count as work
os.environ["OPENBLAS_NUM_THREADS"] = "1"

from collections.abc import Callable
from functools import partial

import numpy as np
import warp as wp

from benchmarks.report import positive, run
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, elapsed
from otwarp.device import pick_device
from otwarp.optics.batched import batched_force
from otwarp.optics.beam import Beam
from otwarp.optics.field import force
from otwarp.optics.mie import Particle

BEAM = Beam(numerical_aperture=1.2, polarization="x")
INDEX = 1.59

POINTS = {0.1: 2000, 0.5: 1500, 1.0: 1000, 2.5: 300, 10.0: 40}
"""Sphere radius [µm], and points for NumPy and for the CPU."""

CUDA_POINTS = {0.1: 1 << 20, 0.5: 1 << 20, 1.0: 1 << 20, 2.5: 1 << 18, 10.0: 1 << 15}
"""Points for a CUDA device: enough to fill it."""


def sample(radius: float, count: int) -> np.ndarray:
    """Random points (count, 3) in the cube that reaches a radius and a half and 1 µm from the focus [µm]."""
    return np.random.default_rng(1).uniform(-1.0, 1.0, (count, 3)) * (1.5 * radius + 1.0)


def rate(work: Callable[[], object], count: int, device: wp.Device, rounds: int, *, cpu: bool) -> Quartiles:
    """Points per second: of processor time, all threads together, if `cpu`, else of wall time."""
    taken = [elapsed(work, device) for _ in range(rounds)]
    return Quartiles.of([count / (t.cpu if cpu else t.wall) for t in taken])


def measure(device: wp.Device, rounds: int) -> Table:
    """One row per radius: first call, points per second, the same of NumPy, largest difference in Q."""
    rows = []
    for radius, few in POINTS.items():
        sphere = Particle(radius=radius, index=INDEX)
        count = few if device.is_cpu else CUDA_POINTS[radius]
        points = sample(radius, count)
        kernel = partial(batched_force, BEAM, sphere, points, device=device)
        first = elapsed(kernel, device).wall
        speed = rate(kernel, count, device, rounds, cpu=device.is_cpu)
        reference = partial(force, BEAM, sphere, points[:few])
        expected = reference()
        numpy = rate(reference, few, device, rounds, cpu=True)
        worst = float(np.abs(kernel()[:few] - expected).max())
        rows.append(
            (
                f"{radius:g} µm",
                f"{count}",
                f"{first:.2f}",
                speed.text(),
                numpy.text(),
                f"{speed.median / numpy.median:.3g}",
                f"{worst:.1e}",
            )
        )
    return Table(
        title=f"Exact forces in float64 on {device.name if device.is_cuda else 'the CPU'}",
        head=("radius", "points", "first call (s)", "points/s", "NumPy, points/s", "ratio", "largest |ΔQ|"),
        rows=rows,
        note=(
            f"NA {BEAM.numerical_aperture:g}, index {INDEX} in {BEAM.medium_index}, median and quartiles of {rounds} "
            "calls from NumPy arrays to NumPy arrays. On a CPU, and for NumPy (one thread), per second of processor "
            "time, all threads together; on a CUDA device per second of wall time. The first call compiles, unless the "
            "kernel is cached on disk, and makes the tables."
        ),
    )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Exact forces per second, of the float64 kernel and of NumPy.")
    parser.add_argument("--device", default="cpu", help="cpu (default) or cuda:0")
    parser.add_argument("--rounds", type=positive, default=5, help="repeats of each figure (default: 5)")
    arguments = parser.parse_args()
    print(measure(pick_device(arguments.device), arguments.rounds).markdown())


if __name__ == "__main__":
    run(main)
