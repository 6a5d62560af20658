"""How a five-element robot diffuses: its 6×6 mobility, refined by surface blobs until it is known to 1 %.

You see its diffusion coefficients along and about its principal axes, fastest first, and where it turns about.
"""

import numpy as np

import otwarp as ot
from otwarp.hydrodynamics import body_mobility

BOLTZMANN = 1.380649e-5  # pN·µm/K


def main(accuracy: float = 0.01) -> np.ndarray:
    scene = ot.Scene.load("scenes/strategy_b.usda")
    spheres = scene.bodies[0].spheres
    centres = np.array([sphere.offset for sphere in spheres])  # µm
    radii = np.array([sphere.radius for sphere in spheres])
    body = body_mobility(centres, radii, accuracy=accuracy)  # of unit viscosity; cached on disk

    diffusion = BOLTZMANN * scene.medium.temperature / scene.medium.viscosity * body.mobility
    print(f"{len(spheres)} spheres, {body.blobs} blobs, estimated error {body.error:.1%}")
    print("translation [µm²/s]", np.linalg.eigvalsh(diffusion[:3, :3])[::-1].round(4))
    print("rotation   [rad²/s]", np.linalg.eigvalsh(diffusion[3:, 3:])[::-1].round(5))
    print("centre of diffusion [µm]", body.reference.round(4))
    return diffusion


if __name__ == "__main__":
    main()
