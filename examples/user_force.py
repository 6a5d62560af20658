"""A force of your own: beads in a double well, which no part of the package knows.

You see out/user_force.png: where 4,000 beads are, beside Boltzmann's distribution.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import warp as wp

import otwarp as ot
from otwarp.scene import Body, Scene, Sphere
from otwarp.units import BOLTZMANN


@ot.force(barrier="pN·µm", half="µm", slope=lambda barrier, half: 8.0 * barrier / half**2)
def double_well(body: ot.ForceInput, barrier: float, half: float):
    """F = −∇U, U = barrier·((x/half)² − 1)² along x, and a spring across."""
    u = body.position / half
    return -4.0 * barrier / half * wp.vec3(u[0] * (u[0] * u[0] - 1.0), u[1], u[2])


def main(worlds: int = 4000, out: str | Path = "out") -> tuple[float, float]:
    bead = Body(prim="/World/bead", spheres=(Sphere(prim="/World/bead/ball", radius=0.5),))
    force = double_well(barrier=2.0 * BOLTZMANN * 298.15, half=0.4)  # or by prim, or swept as double_well_barrier
    sim = ot.Simulation(Scene(bodies=(bead,)), worlds=worlds, seed=1, forces=[force])
    sim.run(1.0)
    found, x = sim.state.position.numpy()[:, 0, 0], np.linspace(-0.8, 0.8, 400)
    theory = np.exp(-2.0 * ((x / 0.4) ** 2 - 1.0) ** 2)
    theory /= np.trapezoid(theory, x)
    axes = plt.figure(figsize=(6, 3.4), layout="constrained").subplots()
    axes.hist(found, bins=40, density=True)
    axes.plot(x, theory, "k")
    axes.set(xlabel="x [µm]", ylabel="density [1/µm]")
    Path(out).mkdir(parents=True, exist_ok=True)
    plt.savefig(Path(out) / "user_force.png", dpi=110)
    return float(np.mean(found**2)), float(np.trapezoid(theory * x**2, x))


if __name__ == "__main__":
    main()
