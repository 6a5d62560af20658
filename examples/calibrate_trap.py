"""A calibration with intervals: forty tracks of a bead, each fitted by its power spectrum, beside the truth.

You see out/calibrate_trap.png: stiffness and 95 % interval of each track; two of forty should miss the line.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot

TRUE, DRAG = 1.0, 0.0168  # pN/µm, pN·s/µm


def main(tracks: int = 40, samples: int = 4096, out: str | Path = "out") -> tuple[np.ndarray, np.ndarray]:
    low, middle, high = [], [], []
    for seed in range(tracks):
        track = ot.analysis.harmonic_tracks([TRUE], drag=DRAG, interval=1e-3, samples=samples, seed=seed)
        found = ot.analysis.fit_spectrum(track, temperature=298.15)
        for values, name in ((low, "stiffness_low"), (middle, "stiffness"), (high, "stiffness_high")):
            values.append(float(np.ravel(found[name])[0]))
    low, middle, high = np.array(low), np.array(middle), np.array(high)
    figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
    axes.errorbar(range(tracks), middle, [middle - low, high - middle], fmt="o", ms=4, capsize=2)
    axes.axhline(TRUE, color="k", lw=1.0)
    axes.set(xlabel="track", ylabel="stiffness [pN/µm]")
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "calibrate_trap.png", dpi=110)
    return low, high


if __name__ == "__main__":
    main()
