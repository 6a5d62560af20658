"""Strategy A against its closed form: a rigid pair in two traps tilts by cos θ = d/((1 − η)L), or lies flat.

You see out/strategy_a.png: the pitchfork, a dot for each of 200 worlds with its own spacing d.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot


def main(worlds: int = 200, duration: float = 1.0, out: str | Path = "out") -> np.ndarray:
    scene = ot.Scene.load("scenes/strategy_a.usda")
    length = np.ptp([sphere.offset[0] for sphere in scene.bodies[0].spheres])  # along the body's X
    eta = scene.traps[0].axial.stiffness / scene.traps[0].radial.stiffness
    spacing = np.linspace(0.4, 1.0, worlds)  # d/L

    sim = ot.Simulation(scene, worlds=worlds)
    place = np.tile(scene.traps[0].position.at(0.0), (worlds, 2, 1))  # (worlds, traps, 3) µm
    place[:, :, 0] = spacing[:, None] * length * [-0.5, 0.5]
    sim.control.set(trap_position=place)  # the traps no longer follow their time samples
    turn = np.tile(scene.bodies[0].orientation, (worlds, 1, 1))  # (worlds, bodies, 4), about Y
    turn[::2, :, 1] *= -1  # either sign is as good
    sim.set_state(orientation=turn)
    sim.run(duration)

    x, y, z, w = sim.state.orientation.numpy()[:, 0].T
    sine, cosine = 2 * (x * z - y * w), np.minimum(1.0, spacing / (1 - eta))
    figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
    axes.plot(spacing, np.outer(np.sqrt(1 - cosine**2), [1, -1]), "k", spacing, sine, ".")
    axes.set(xlabel="spacing of the traps d/L", ylabel="sin θ")
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "strategy_a.png", dpi=110)
    return np.sqrt(1 - sine**2) - cosine


if __name__ == "__main__":
    main()
