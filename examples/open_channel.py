"""An open channel: cells that the flow carries out of it come in again at the inlet, one of the shipped channel's ends.

You see out/open_channel.png: how many cells have come in by a time, beside what a steady flow of as many would carry.
"""

import dataclasses
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot


def main(duration: float = 5.0, out: str | Path = "out") -> tuple[np.ndarray, np.ndarray]:
    scene = ot.Scene.load("scenes/microfluidic_channel.usda")
    length = scene.settings.period[0]
    domain = {"domain_low": (-length / 2, 0.0, 0.0), "domain_high": (length / 2, 0.0, 0.0)}
    inlet = {"inlet_low": (-length / 2, -40.0, 4.0), "inlet_high": (6.0 - length / 2, 40.0, 20.0)}  # off the walls
    settings = dataclasses.replace(scene.settings, period=(0.0, 0.0, 0.0), **domain, **inlet)
    sim = ot.Simulation(dataclasses.replace(scene, settings=settings), seed=1)
    cells = np.array([body.kind == "cell" for body in scene.bodies])
    time, entries, mean = [0.0], [0], [0.0]
    while sim.time < duration:
        before, crossed = sim.state.position.numpy().copy(), sim.readout.entries.numpy().copy()
        sim.run(0.1)
        moved = (sim.state.position.numpy() - before)[0, cells, 0]
        stayed = (sim.readout.entries.numpy() == crossed)[0, cells]
        time.append(sim.time)
        entries.append(int(sim.readout.entries.numpy().sum()))
        mean.append(mean[-1] + moved[stayed].mean() * cells.sum() / length)  # cells that a cross-section sees
    axes = plt.figure(figsize=(6, 3.4), layout="constrained").subplots()
    axes.step(time, entries, label="cells that came in")
    axes.plot(time, mean, "k", label="mean speed × cells per length")
    axes.set(xlabel="time [s]", ylabel="cells")
    axes.legend()
    Path(out).mkdir(parents=True, exist_ok=True)
    plt.savefig(Path(out) / "open_channel.png", dpi=110)
    return np.array(entries), np.array(mean)


if __name__ == "__main__":
    main()
