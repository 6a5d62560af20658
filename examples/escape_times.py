"""Escape times: 256 worlds run 2,000 trials; a world that has lost its bead starts the next trial.

You see out/escape_times.png: how many trials still hold their bead after a time, and an exponential of the exact mean.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import erf

import otwarp as ot

ENERGY = 1.380649e-5 * 298.15  # k_B T [pN·µm]


def main(worlds: int = 256, trials: int = 2000, barrier: float = 3.0, out: str | Path = "out") -> tuple[float, float]:
    scene = ot.Scene.load("scenes/single_bead.usda")
    stiffness = scene.traps[0].radial.stiffness  # at 1 mW [pN/µm]
    spread, edge = np.sqrt(ENERGY / stiffness), np.sqrt(2.0 * barrier * ENERGY / stiffness)  # µm
    even = {"trap_axial_stiffness": stiffness, "trap_cutoff": edge, "trap_axial_cutoff": edge}
    parameters = {**even, "trap_position": scene.bodies[0].position}
    sim = ot.Simulation(scene, worlds=worlds, seed=1, parameters=parameters, ends=[ot.escaped])
    time = np.full(trials, np.nan)
    while np.isnan(time).any():
        sim.step(500)
        number, step = sim.episodes.number.numpy(), sim.readout.escape_step.numpy()[:, 0]
        ended = (step >= 0) & (number < trials)
        time[number[ended]] = (step[ended] - 0.5) * sim.time_step
        sim.reset(sim.episodes.done)
    u = np.linspace(1e-6, edge / spread, 4001)  # mean first passage, by quadrature over u = r/spread
    within = np.sqrt(np.pi / 2.0) * erf(u / np.sqrt(2.0)) - u * np.exp(-(u**2) / 2.0)
    drag = 6.0 * np.pi * scene.medium.viscosity * scene.bodies[0].spheres[0].radius
    mean = drag / stiffness * np.trapezoid(within * np.exp(u**2 / 2.0) / u**2, u)
    axes = plt.figure(figsize=(6, 3.4), layout="constrained").subplots()
    axes.semilogy(np.sort(time), 1.0 - np.arange(trials) / trials, np.sort(time), np.exp(-np.sort(time) / mean), "k")
    axes.set(xlabel="time [s]", ylabel="part that holds its bead")
    Path(out).mkdir(parents=True, exist_ok=True)
    plt.savefig(Path(out) / "escape_times.png", dpi=110)
    return time.mean(), mean


if __name__ == "__main__":
    main()
