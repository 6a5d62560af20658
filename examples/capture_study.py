"""A study: how likely a bead is caught, by where it starts beside the trap, with intervals.

You see out/capture_study.png: certain near the trap, hopeless far from it, and how sure that is.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot


def main(points: int = 10, trials: int = 100, out: str | Path = "out") -> np.ndarray:
    start = np.linspace(1.4, 3.0, points)  # µm
    study = ot.Study(
        "scenes/table_trap.usda",
        axes={"start.x:/World/bead": ot.values(start, unit="µm")},
        observables=[ot.trapped(until=0.5)],
        stop=ot.trials(trials),
        seed=7,
    )
    with tempfile.TemporaryDirectory() as folder:
        table = study.run(Path(folder) / "study")  # an xarray.Dataset
    caught = table["trapped"].values
    figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
    axes.fill_between(start, table["trapped_low"], table["trapped_high"], alpha=0.3)
    axes.plot(start, caught, "o-")
    axes.set(xlabel="start beside the trap [µm]", ylabel="caught after 0.5 s")
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "capture_study.png", dpi=110)
    return caught


if __name__ == "__main__":
    main()
