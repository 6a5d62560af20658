"""A microscope image: three glass spheres seen in four focal planes, light led through them once.

You see out/microscope_image.png: dark discs below the plane, a sharp outline in it, bright discs above.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from otwarp.vision import Microscope, Specimen, expose

PLACES = [[-1.6, 0.0, 0.0], [0.0, 0.0, 0.4], [1.6, 0.0, 0.0]]  # µm
PLANES = (-2.0, 0.0, 1.0, 2.0)  # µm


def main(pixels: int = 128, out: str | Path = "out") -> np.ndarray:
    robot = Specimen.of_spheres(PLACES, 0.9, 1.52)  # radius [µm], index
    light = expose(robot, Microscope(numerical_aperture=1.2, condenser_aperture=0.4), pixels)
    stack = light.images(list(PLANES))  # (planes, pixels, pixels), 1 where light is unhindered
    figure, axes = plt.subplots(1, len(PLANES), figsize=(10, 2.8), layout="constrained")
    for axis, image, z in zip(axes, stack, PLANES, strict=True):
        axis.imshow(image, cmap="gray", origin="lower", vmin=0.2, vmax=1.8)
        axis.set(title=f"{z:+g} µm", xticks=[], yticks=[])
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "microscope_image.png", dpi=110)
    return np.asarray(stack)


if __name__ == "__main__":
    main()
