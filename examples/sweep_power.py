"""A sweep in one run: 1,000 worlds, each with its own trap power from 0.1 to 5 mW.

You see out/sweep_power.png: the spread of the bead falls as √(k_B T/k), k in proportion to the power.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot

BOLTZMANN = 1.380649e-5  # pN·µm/K


def main(worlds: int = 1000, samples: int = 200, out: str | Path = "out") -> np.ndarray:
    power = np.geomspace(0.1, 5.0, worlds)  # mW
    scene = ot.Scene.load("scenes/single_bead.usda")
    sim = ot.Simulation(scene, worlds=worlds, seed=1, parameters={"trap_power": power[:, None]})
    square = np.zeros(worlds)
    for _ in range(samples):
        sim.run(0.02)
        square += (sim.state.position.numpy()[:, 0, :2] ** 2).mean(axis=1) / samples  # µm²
    theory = BOLTZMANN * scene.medium.temperature / (scene.traps[0].radial.stiffness * power)
    figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
    axes.loglog(power, 1e3 * np.sqrt(square), ".", power, 1e3 * np.sqrt(theory), "k")
    axes.set(xlabel="trap power [mW]", ylabel="√⟨x²⟩ [nm]")
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "sweep_power.png", dpi=110)
    return square / theory


if __name__ == "__main__":
    main()
