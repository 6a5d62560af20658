"""An optical force, exact and from a table: how large the table's error is, and where the bead rests.

You see the trap's stiffness and depth, the table's error beside its tolerance, and out/optical_force.png: the force.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from otwarp.optics import Beam, Particle, build_table, force, trap_properties


def main(points: int = 500, tolerance: float = 1e-3, out: str | Path = "out") -> float:
    beam = Beam(numerical_aperture=1.2, power=20.0)  # mW
    sphere = Particle(radius=0.5, index=1.59)  # µm
    trap = trap_properties(beam, sphere)
    print(f"rests {trap.equilibrium:+.3f} µm from the focus")
    print(f"stiffness across {trap.stiffness[0]:.1f}, along the beam {trap.stiffness[2]:.1f} pN/µm")

    table = build_table(beam, sphere, tolerance=tolerance)  # cached on disk
    places = np.random.default_rng(0).uniform(-1.5, 1.5, (points, 3))  # µm from the focus
    exact = force(beam, sphere, places)  # (n, 3) Q; force = 3.33564·n·P·Q pN
    error = float(np.abs(table.force(places) - exact).max() / np.abs(exact).max())
    print(f"table of {table.size / 1e3:.0f} kB: error {error:.1e} of the peak, built for {tolerance:g}")
    x = np.linspace(-1.5, 1.5, 121)
    figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
    for axis, name in ((0, "across the beam"), (2, "along it")):
        axes.plot(x, beam.force_scale * force(beam, sphere, np.outer(x, np.eye(3)[axis]))[:, axis], label=name)
    axes.set(xlabel="distance from the focus [µm]", ylabel="force [pN]")
    axes.legend()
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "optical_force.png", dpi=110)
    return error


if __name__ == "__main__":
    main()
