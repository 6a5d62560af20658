"""What a trap can hold: escape force and stiffness across the beam, exact, for spheres of many radii.

You see out/escape_force.png: stiffness is largest for spheres about as wide as the focus, what can be held still grows.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from otwarp.optics import Beam, Particle, trap_properties


def main(radii: int = 12, out: str | Path = "out") -> np.ndarray:
    beam, radius = Beam(numerical_aperture=1.2, power=10.0), np.linspace(0.3, 2.0, radii)  # mW, µm
    found = [trap_properties(beam, Particle(radius=float(r), index=1.59)) for r in radius]
    stiffness = np.array([f.stiffness[0] for f in found])  # pN/µm
    escape = np.array([f.escape_force[0] for f in found])  # pN
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
    left.plot(radius, stiffness, "o-")
    left.set(xlabel="radius [µm]", ylabel="stiffness [pN/µm]")
    right.plot(radius, escape, "o-", color="C3")
    right.set(xlabel="radius [µm]", ylabel="escape force [pN]")
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "escape_force.png", dpi=110)
    return escape


if __name__ == "__main__":
    main()
