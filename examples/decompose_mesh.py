"""A mesh as spheres: how a ring, which no law of optical forces knows, becomes a body that traps can hold.

You see out/decompose_mesh.png: the ring from above under 6, 12 and 24 spheres, and how much of it is misplaced.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

from otwarp.hydrodynamics.decomposition import decompose

RING = trimesh.creation.torus(major_radius=3.0, minor_radius=0.8)  # µm; or a file: decompose("part.stl", …)


def main(counts: tuple[int, ...] = (6, 12, 24), out: str | Path = "out") -> np.ndarray:
    found = [decompose(RING, spheres=count) for count in counts]
    figure, axes = plt.subplots(1, len(counts), figsize=(3.3 * len(counts), 3.6), layout="constrained", squeeze=False)
    for axis, spheres in zip(axes[0], found, strict=True):
        for (x, y, _), radius in zip(spheres.centres, spheres.radii, strict=True):
            axis.add_patch(plt.Circle((x, y), radius, color="C0", alpha=0.4))
        for edge in (2.2, 3.8):
            axis.add_patch(plt.Circle((0, 0), edge, fill=False, color="k", lw=1.0))
        misplaced, mobility = 100 * spheres.volume_error, 100 * spheres.mobility_error
        axis.set(title=f"errors: volume {misplaced:.0f} %, mobility {mobility:.0f} %", xlabel="x [µm]", aspect="equal")
        axis.set(xlim=(-4.2, 4.2), ylim=(-4.2, 4.2))
    axes[0, 0].set(ylabel="y [µm]")
    Path(out).mkdir(parents=True, exist_ok=True)
    figure.savefig(Path(out) / "decompose_mesh.png", dpi=110)
    return np.array([spheres.volume_error for spheres in found])


if __name__ == "__main__":
    main()
