"""How a five-element robot diffuses: its 6×6 mobility, refined by surface blobs until it is known to 1 %.

You see its diffusion coefficients along and about its principal axes, fastest first, where it turns about, and
out/robot_mobility.png: how far it wanders and turns in a second along and about its own axes.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot
from otwarp.hydrodynamics import body_mobility

BOLTZMANN = 1.380649e-5  # pN·µm/K


def main(accuracy: float = 0.01, out: str | Path = "out") -> np.ndarray:
    scene = ot.Scene.load("scenes/strategy_b.usda")
    spheres = scene.bodies[0].spheres
    centres, radii = np.array([s.offset for s in spheres]), np.array([s.radius for s in spheres])  # µm
    body = body_mobility(centres, radii, accuracy=accuracy)  # of unit viscosity; cached on disk

    diffusion = BOLTZMANN * scene.medium.temperature / scene.medium.viscosity * body.mobility
    print(f"{len(spheres)} spheres, {body.blobs} blobs, estimated error {body.error:.1%}")
    print("translation [µm²/s]", np.linalg.eigvalsh(diffusion[:3, :3])[::-1].round(4))
    print("rotation   [rad²/s]", np.linalg.eigvalsh(diffusion[3:, 3:])[::-1].round(5))
    print("centre of diffusion [µm]", body.reference.round(4))
    wander = np.sqrt(2.0 * np.diag(diffusion))  # in a second: µm and rad
    figure, (left, right) = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
    left.bar(["x", "y", "z"], 1e3 * wander[:3], width=0.5)
    left.set(xlabel="along", ylabel="wandered in 1 s [nm]")
    right.bar(["x", "y", "z"], np.degrees(wander[3:]), width=0.5, color="C3")
    right.set(xlabel="about", ylabel="turned in 1 s [°]")
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "robot_mobility.png", dpi=110)
    return diffusion


if __name__ == "__main__":
    main()
