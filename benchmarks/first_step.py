"""Probe: from the start of this process to the first step of a scene, as one line of JSON.

`python -m benchmarks.first_step SCENE DEVICE` prints `{phase: monotonic time at its end, ...}`. The parent compares
with the time at which it gave the command; the monotonic clock is one for all processes of a machine.
"""

from __future__ import annotations

import time

MARKS = {"interpreter": time.monotonic()}


def main(scene_file: str, device: str) -> dict[str, float]:
    """Take the first step of a scene and return when each phase ended [s]."""
    import otwarp.cli.main
    import otwarp.scene.load  # noqa: F401 imported lazily by Scene.load; here it belongs to the imports
    from otwarp.device import pick_device
    from otwarp.scene.description import Scene
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
    sim.step()
    MARKS["first step"] = time.monotonic()
    return MARKS


if __name__ == "__main__":
    import json
    import sys

    print(json.dumps(main(sys.argv[1], sys.argv[2])))
