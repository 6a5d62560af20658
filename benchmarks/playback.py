"""What `otwarp view` takes to open a long recording, to show a moment of it, and to draw its curves.

    python -m benchmarks.playback [--frames 100000]

A run of `scenes/teleop_small.usda` with as many frames is written, a short simulation again and again, and read back.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np

from otwarp.view import RecordedRun
from otwarp.view.curves import charts

SHOWN = 300
"""Moments that are shown, all over the run."""


def write_run(folder: Path, frames: int) -> None:
    """Record a short run, then lengthen its numbers: the recorder writes each frame to disk, which takes long."""
    from scipy.io import netcdf_file

    from otwarp.record import record_run
    from otwarp.scene import Scene

    scene = Scene.load(Path(__file__).resolve().parents[1] / "scenes" / "teleop_small.usda", duration=0.2)
    record_run(scene, folder)
    source = netcdf_file(str(folder / "run.nc"), "r", mmap=False)
    with source as short, netcdf_file(str(folder / "long.nc"), "w", version=2) as long:
        for name in short._attributes:
            setattr(long, name, getattr(short, name))
        for name, length in short.dimensions.items():
            long.createDimension(name, length)
        for name, variable in short.variables.items():
            copy = long.createVariable(name, variable.data.dtype, variable.dimensions)
            if variable.dimensions[0] != "frame":
                copy[:] = variable.data
                continue
            rows = np.resize(variable.data, (frames, *variable.data.shape[1:]))
            copy[:frames] = np.arange(frames) / 60.0 if name == "time" else rows
    (folder / "long.nc").replace(folder / "run.nc")


def main() -> None:
    """Print the times, and how large the file is."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--frames", type=int, default=100_000)
    frames = parser.parse_args().frames
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "run"
        write_run(folder, frames)
        begun = time.perf_counter()
        run = RecordedRun(folder)
        opened = time.perf_counter() - begun
        each = []
        for index in np.random.default_rng(1).integers(0, frames, SHOWN):
            begun = time.perf_counter()
            run.frame(int(index))
            each.append(time.perf_counter() - begun)
        begun = time.perf_counter()
        charts(run)
        curves = time.perf_counter() - begun
        size = run.file.stat().st_size / 2**20
        run.close()
    print(f"{frames:,} frames, {size:.0f} MB: opened in {opened:.2f} s, of which the scene is most")
    print(f"a moment anywhere: {1e3 * median(each):.2f} ms (median of {SHOWN})")
    print(f"curves of the whole run: {curves:.2f} s, in a thread beside the page")


if __name__ == "__main__":
    main()
