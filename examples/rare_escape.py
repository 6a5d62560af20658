"""Rare escapes by forward-flux sampling: how long a trap keeps a bead, far longer than anybody could wait.

You see out/rare_escape.png: the mean time to an escape with its interval, over five powers; a dotted line is an hour.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot


def main(points: int = 5, branches: int = 300, out: str | Path = "out") -> np.ndarray:
    study = ot.EscapeStudy(
        "scenes/table_trap.usda",
        axes={"trap_power": ot.grid(0.04, 0.2, points, unit="mW", spacing="log")},
        runs=4,
        branches=branches,
        halved=False,
        seed=7,
    )
    with tempfile.TemporaryDirectory() as folder:
        table = study.run(Path(folder) / "study")  # an xarray.Dataset
    power, time = table["trap_power"].values, table["escape_time"].values  # mW, s
    below, above = time - table["escape_time_low"].values, table["escape_time_high"].values - time
    figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
    axes.errorbar(power, time, [below, above], fmt="o-", capsize=3)
    axes.axhline(3600.0, color="0.5", ls=":")
    axes.set(xlabel="trap power [mW]", ylabel="mean time to an escape [s]", yscale="log")
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "rare_escape.png", dpi=110)
    return time


if __name__ == "__main__":
    main()
