"""Probe: from the start of this process to the first step of a recorded run, as one line of JSON.

`python -m benchmarks.first_step SCENE DEVICE FOLDER` does what `otwarp run` does up to the first step and prints
`{phase: monotonic time at its end, ...}`. The parent compares with the time at which it gave the command; the
monotonic clock is one for all processes of a machine.
"""

from __future__ import annotations

import time

MARKS = {"interpreter": time.monotonic()}


def main(scene_file: str, device: str, folder: str) -> dict[str, float]:
    """Take the first step of a scene and return when each phase ended [s]; the recording is left unfinished."""
    from pathlib import Path

    import otwarp.cli.main
    import otwarp.cli.run
    import otwarp.scene.read.load  # noqa: F401 imported lazily by Scene.load; here it belongs to the imports
    from otwarp.device import pick_device
    from otwarp.record.recorder import Recorder
    from otwarp.scene import Scene
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
    sim = Simulation(scene, device=place)
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
    MARKS["first step"] = time.monotonic()
    return MARKS


if __name__ == "__main__":
    import json
    import os
    import sys

    print(json.dumps(main(*sys.argv[1:])), flush=True)
    # nobody waits for the recording of one frame to be closed
    os._exit(0)
