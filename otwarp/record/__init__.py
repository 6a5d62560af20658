"""The recording room: frames of a run to USD, netCDF, a summary and a figure, as they come.

    with Recorder(scene, "out/run", frames_per_second=60.0, held=sim.model.held, time_step=sim.time_step) as recorder:
        recorder.write(frame)

Frames of a simulation come in (`otwarp.simulation.frame`), the files of a run go out. Open `run` first.

| file | what it holds |
|---|---|
| `run` | `record_run`, behind `otwarp run`: what a run is refused for, before anything is allocated |
| `method` | `Method`: how the run was computed |
| `recorder` | `Recorder`: hands frames on, and keeps the folder readable whatever happens to the program |
| `interrupts` | Ctrl-C and SIGTERM wait until all files have a frame |
| `netcdf`, `netcdf4_internals` | `run.nc`; what it needs of the library beyond its promises |
| `monitor`, `statistics` | whether the task succeeded, and running means |
| `summary` | `summary.json` |
| `folder` | what is found in a folder: whether a run is whole, ended early, or would be replaced |
| `read`, `figure`, `footprint` | `run.nc` read back for `figure.png`; outlines of obstacles from above |

`run.usda` is written by `otwarp.scene.recording`, where USD is known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.record.figure import draw as draw
    from otwarp.record.method import Method as Method
    from otwarp.record.read import Run as Run
    from otwarp.record.read import read_run as read_run
    from otwarp.record.recorder import Recorder as Recorder
    from otwarp.record.run import check_run as check_run
    from otwarp.record.run import record_run as record_run

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "figure": ("draw",),
        "method": ("Method",),
        "read": ("Run", "read_run"),
        "recorder": ("Recorder",),
        "run": ("check_run", "record_run"),
    },
)
