"""Model, State, Control, Readout, the one object that steps them: Simulation; and a moment of it on the host: Frame.

In: a `Scene`, how to step it (`options.StepOptions`), parameters and forces of the user (`user_forces`). Out: device
arrays that change in place (`state`), frames (`frame`), checkpoints (`checkpoint`), plain data (`info`). Open
`simulation` first, then `model`: `resolved`, `composition` and `body_space` decide what the kernels of a scene are made
of, `drivers` launches them; `powers` refuses what is commanded beyond the step.

`episodes` are worlds that end and start anew: `ends` says what ends them, `stored_ends` keeps these in
checkpoints, `starts` how they are reset. `capture` makes a graph of a user's loop, `sharded` shares worlds out to
several devices.

    drivers    who launches the kernels of a step, on which memory
    packing    a scene's description as the arrays that kernels read
    time_step  what limits the time step, and the step that follows
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.simulation.frame import Frame as Frame
    from otwarp.simulation.frame import capture_frame as capture_frame
    from otwarp.simulation.model import Model as Model
    from otwarp.simulation.simulation import Simulation as Simulation
    from otwarp.simulation.state import Control as Control
    from otwarp.simulation.state import Readout as Readout
    from otwarp.simulation.state import State as State

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "frame": ("Frame", "capture_frame"),
        "model": ("Model",),
        "simulation": ("Simulation",),
        "state": ("Control", "Readout", "State"),
    },
)
