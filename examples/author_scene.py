"""A scene from Python: a trap carries a bead, is written as USD, read back, and run in 400 worlds.

You see out/carried_bead.usda (for usdview or Blender), and the mean lag behind the trap beside Stokes' law, γv/k;
out/author_scene.png: the lag in all worlds.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot
from otwarp.scene import Body, SceneBuilder, Settings, Sphere, Track, Trap, TrapLaw

BEAD = Sphere(prim="/World/bead/sphere", radius=1.0)
WAY = Track(times=np.array([0.0, 1.0]), values=np.array([[0.0, 0.0, 5.0], [20.0, 0.0, 5.0]]))  # 20 µm/s
LAW = TrapLaw(stiffness=2.0, power=1.0)  # pN/µm at 1 mW
POWER = 5.0  # mW


def main(worlds: int = 400, duration: float = 0.5, out: str | Path = "out") -> tuple[float, float]:
    builder = SceneBuilder(settings=Settings(duration=1.0))
    builder.add(Body(prim="/World/bead", position=(0, 0, 5), spheres=(BEAD,)))
    builder.add(Trap(prim="/World/trap", position=WAY, power=Track.constant(POWER), model="harmonic", radial=LAW))
    file = Path(out) / "carried_bead.usda"
    file.parent.mkdir(parents=True, exist_ok=True)
    builder.save(file)
    scene = ot.Scene.load(file)
    sim = ot.Simulation(scene, worlds=worlds, seed=3)
    sim.run(duration)
    trap, bead = sim.readout.trap_position.numpy()[:, 0], sim.state.position.numpy()[:, 0]  # (worlds, 3) µm
    lags = (trap - bead)[:, 0]
    theory = 6 * np.pi * scene.medium.viscosity * BEAD.radius * 20.0 / (LAW.stiffness * POWER)
    print(f"lag {1e3 * lags.mean():.1f} nm, γv/k = {1e3 * theory:.1f} nm")
    axes = plt.figure(figsize=(6, 3.2), layout="constrained").subplots()
    axes.hist(1e3 * lags, bins=25)
    axes.axvline(1e3 * theory, color="k")
    axes.set(xlabel="behind the trap [nm]", ylabel="worlds")
    plt.savefig(Path(out) / "author_scene.png", dpi=110)
    return float(lags.mean()), theory


if __name__ == "__main__":
    main()
