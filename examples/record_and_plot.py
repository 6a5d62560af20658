"""A recorded run, read back with xarray: the files of `otwarp run`, and a picture of your own.

You see out/bead/: run.usda for usdview, run.nc, summary.json, figure.png; and path.png, which is drawn here.
"""

from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import xarray

import otwarp as ot
from otwarp.record import record_run


def main(duration: float = 1.0, out: str | Path = "out/bead") -> dict:
    scene = ot.Scene.load("scenes/single_bead.usda")
    scene = replace(scene, settings=replace(scene.settings, duration=duration))
    summary = record_run(scene, out, worlds=2, seed=1)  # the Python call behind `otwarp run`

    figure, (above, below) = plt.subplots(2, sharex=True, figsize=(6, 4), layout="constrained")
    with xarray.open_dataset(Path(out) / "run.nc") as run:
        for axis, name in enumerate("xy"):
            above.plot(run.time, 1e3 * run.position.isel(world=0, body=0, xyz=axis), label=name)
            below.plot(run.time, run.trap_force.isel(world=0, trap=0, xyz=axis), label=name)
    above.set(ylabel="position [nm]")
    below.set(ylabel="trap force [pN]", xlabel="time [s]")
    above.legend()
    figure.savefig(Path(out) / "path.png", dpi=110)
    return summary


if __name__ == "__main__":
    main()
