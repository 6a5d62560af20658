"""Probe: from the start of this process to the first step of a recorded run, as one line of JSON.

`python -m benchmarks.first_step SCENE DEVICE FOLDER` does what `otwarp run` does up to the first step and prints
`{phase: monotonic time at its end, ...}`, and on a CUDA device the memory that is in use there and what the kernels
reserve of it. The parent compares with the time at which it gave the command; the
monotonic clock is one for all processes of a machine.
"""

from __future__ import annotations

import time

MARKS = {"interpreter": time.monotonic()}


def main(scene_file: str, device: str, folder: str) -> dict[str, float]:
    """Take the first step of a scene and return when each phase ended [s]; the recording is left unfinished.

    On a CUDA device also `in use`, all memory of the device that is [bytes], and `reserved`, by its largest kernel.
    """
    from pathlib import Path

    import warp as wp

    import otwarp.cli.main
    import otwarp.cli.run
    import otwarp.scene.read.load  # noqa: F401 imported lazily by Scene.load; here it belongs to the imports
    from otwarp.device import pick_device
    from otwarp.kernels.step import make_step
    from otwarp.record.recorder import Recorder
    from otwarp.scene import Scene
    from otwarp.simulation.drivers.compilation import kernel_memory
    from otwarp.simulation.frame import capture_frame
    from otwarp.simulation.model import Model
    from otwarp.simulation.simulation import Simulation

    MARKS["imports"] = time.monotonic()
    place = pick_device(device)
    MARKS["Warp start"] = time.monotonic()
    scene = Scene.load(scene_file)
    MARKS["scene"] = time.monotonic()
    build = Model.build

    def noted(*arguments: object, **named: object) -> Model:
        model = build(*arguments, **named)
        MARKS["model"] = time.monotonic()
        return model

    # the constructor builds the model first; what follows is composing, compiling and loading the kernels
    Model.build = noted
    sim = Simulation(scene, device=place, readout=True)
    MARKS["kernels"] = time.monotonic()
    recorder = Recorder(
        scene,
        Path(folder),
        frames_per_second=scene.settings.frames_per_second,
        time_step=sim.time_step,
        held=sim.model.held,
    )
    recorder.write(capture_frame(sim))
    MARKS["first frame"] = time.monotonic()
    sim.step()
    wp.synchronize_device(place)
    MARKS["first step"] = time.monotonic()
    if place.is_cuda:
        MARKS["in use"] = place.total_memory - place.free_memory
        MARKS["reserved"] = max(
            row.reserved for row in kernel_memory(make_step(sim.model.features).kernels, place, load=True)
        )
    return MARKS


if __name__ == "__main__":
    import json
    import os
    import sys

    print(json.dumps(main(*sys.argv[1:])), flush=True)
    # nobody waits for the recording of one frame to be closed
    os._exit(0)
