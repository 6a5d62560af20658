# %% [markdown]
# # A robot: how it diffuses, and what light does to it
#
# A microrobot is a rigid body of spheres. The liquid between its spheres moves with all of them, and each sphere in a
# focus scatters its light. Both are computed here, with their errors.

# %%
import matplotlib.pyplot as plt
import numpy as np

from otwarp.hydrodynamics import body_mobility
from otwarp.optics import Beam, Particle, build_table, force, trap_properties
from otwarp.units import BOLTZMANN

places = np.array([(-4.0, 0.0, 0.0), (0.0, 2.0, 0.0), (4.0, 0.0, 0.0)])  # µm
radius, index, viscosity, temperature = 1.25, 1.52, 0.89e-3, 298.15  # µm, -, Pa·s, K

# %% [markdown]
# ## Mobility
#
# The spheres are covered with small blobs that push the liquid, finer and finer, until the 6×6 matrix is known to 1
# %.

# %%
robot = body_mobility(places, np.full(3, radius), accuracy=0.01)  # of unit viscosity
diffusion = BOLTZMANN * temperature / viscosity * robot.mobility  # µm²/s, µm·rad/s, rad²/s
alone = BOLTZMANN * temperature / (6 * np.pi * viscosity * radius)
print(f"{robot.blobs} blobs, estimated error {robot.error:.2%}")
print("along x, y, z   [µm²/s]", np.diag(diffusion)[:3].round(4))
print("about x, y, z  [rad²/s]", np.diag(diffusion)[3:].round(5))
print(f"a single sphere [µm²/s] {alone:.4f}, and a third of it, without the liquid between them, {alone / 3:.4f}")
assert np.all(np.diag(diffusion)[:3] > alone / 3), "spheres that share their liquid drag less of it"

# %% [markdown]
# ## The force on one of its spheres
#
# A focused beam, scattered by a sphere of this size and index: exact, and from a table that a simulation looks up.

# %%
beam, sphere = Beam(numerical_aperture=1.2, power=10.0), Particle(radius=radius, index=index)  # mW
trap = trap_properties(beam, sphere)
print(f"rests {trap.equilibrium:+.3f} µm from the focus; stiffness {np.round(trap.stiffness, 2)} pN/µm")
table = build_table(beam, sphere, tolerance=1e-3)

# %%
x = np.linspace(-2.5, 2.5, 121)
level = np.stack([x, 0 * x, np.full_like(x, trap.equilibrium)], axis=1)
exact, looked_up = force(beam, sphere, level), table.force(level)
figure, (above, below) = plt.subplots(2, figsize=(7, 4.4), sharex=True, layout="constrained", height_ratios=(2, 1))
above.plot(x, beam.force_scale * exact[:, 0], label="across the beam")
above.plot(x, beam.force_scale * exact[:, 2], label="along it")
above.set(ylabel="force [pN]")
above.legend()
below.plot(x, beam.force_scale * (looked_up - exact)[:, 0], color="C3")
below.set(xlabel="distance from the beam [µm]", ylabel="table − exact [pN]")
error = np.abs(looked_up - exact).max() / np.abs(exact).max()
print(f"table of {table.size / 1e3:.0f} kB: {error:.1e} of the peak force")
assert error < 2e-3

# %% [markdown]
# ## Three traps, and the robot between them
#
# With a focus on each sphere the robot moves against three springs; turned by a small angle it feels a torque.

# %%
angle = np.radians(np.linspace(-40, 40, 41))
torque = []
for turn in angle:
    c, s = np.cos(turn), np.sin(turn)
    moved = places @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    off = moved - places + [0.0, 0.0, trap.equilibrium]
    torque.append(np.cross(moved, beam.force_scale * force(beam, sphere, off))[:, 2].sum())
figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
axes.plot(np.degrees(angle), torque)
axes.axhline(0, color="0.7", lw=0.8)
axes.set(xlabel="turned about the beams by [°]", ylabel="torque [pN·µm]")
assert torque[22] < 0 < torque[18], "it turns back"
