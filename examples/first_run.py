"""A bead in a trap: its spread is what equipartition says, √(k_B T/k), in 1,000 worlds at once.

You see two lines, measured and theory, that agree to about 2 %, and out/first_run.png: where the beads are.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot

BOLTZMANN = 1.380649e-5  # pN·µm/K


def main(worlds: int = 1000, duration: float = 0.2, out: str | Path = "out") -> tuple[float, float]:
    scene = ot.Scene.load("scenes/single_bead.usda")
    sim = ot.Simulation(scene, worlds=worlds, seed=7)  # device="cuda:0" | "cpu"; the best available
    sim.run(duration)  # [s], many relaxation times

    x = sim.state.position.numpy()[:, 0, 0]  # (worlds, bodies, 3) µm
    law = scene.traps[0].radial
    stiffness = law.stiffness / law.power * scene.traps[0].power.at(0.0).item()  # pN/µm
    expected = np.sqrt(BOLTZMANN * scene.medium.temperature / stiffness)
    print(f"measured √⟨δx²⟩ = {1e3 * x.std():.1f} nm")
    print(f"theory   √(k_B T/k) = {1e3 * expected:.1f} nm")
    figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
    axes.hist(1e3 * x, bins=30, density=True)
    u = np.linspace(-4.0, 4.0, 200)
    axes.plot(1e3 * expected * u, np.exp(-(u**2) / 2) / (1e3 * expected * np.sqrt(2 * np.pi)), "k")
    axes.set(xlabel="x [nm]", ylabel="density [1/nm]")
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "first_run.png", dpi=110)
    return float(x.std()), float(expected)


if __name__ == "__main__":
    main()
