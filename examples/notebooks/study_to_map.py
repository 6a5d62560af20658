# %% [markdown]
# # From one start to a map
#
# A bead is let go beside a trap. Is it caught? One run says yes or no; what one wants is how often, by the trap's
# power and by where the bead starts, and how sure that is.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot

# %% [markdown]
# ## One start, many times
#
# 200 worlds of one scene differ by the liquid's noise alone.

# %%
scene = ot.Scene.load("table_trap")  # a shipped scene, by name
sim = ot.Simulation(scene, worlds=200, seed=1, parameters={"trap_power": 0.5})
place = np.tile(np.add(scene.bodies[0].position, (1.2, 0.0, 0.0)), (200, 1, 1))  # (worlds, bodies, 3) µm
sim.set_state(position=place)
focus, distance = sim.readout.trap_position.numpy()[0, 0, :2], []
for _ in range(40):
    sim.run(0.0125)
    distance.append(np.linalg.norm(sim.state.position.numpy()[:, 0, :2] - focus, axis=1))
time = 0.0125 * np.arange(1, 41)
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
axes.plot(time, np.array(distance)[:, :40], color="C0", lw=0.6, alpha=0.6)
axes.set(xlabel="time [s]", ylabel="distance from the beam [µm]", yscale="log")

# %% [markdown]
# ## All starts: a study
#
# Two axes, a question, and when to stop: every point runs trials until its interval is ± 0.1.

# %%
study = ot.Study(
    scene,
    axes={
        "trap_power": ot.grid(0.1, 5.0, 6, unit="mW", spacing="log"),
        "start.x:/World/bead": ot.grid(1.4, 2.8, 8, unit="µm"),
    },
    observables=[ot.trapped(until=0.5)],
    stop=ot.half_width(0.1, at_most=96),
    seed=7,
)
print(study.plan())  # what it would cost; nothing has run

# %%
with tempfile.TemporaryDirectory() as folder:
    table = study.run(Path(folder) / "capture")  # stopped at any moment, the same line goes on
print(table["trapped"].shape, "points,", int(table["trials"].sum()), "trials")

# %% [markdown]
# ## The map, and where the odds are even

# %%
power, start = table["trap_power"].values, table["start_x_bead"].values
caught = table["trapped"].transpose("trap_power", "start_x_bead").values
figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
shown = axes.pcolormesh(power, start, caught.T, cmap="viridis", vmin=0, vmax=1, shading="nearest")
axes.contour(power, start, caught.T, levels=[0.5], colors="w")
axes.set(xscale="log", xlabel="trap power [mW]", ylabel="start beside the trap [µm]")
figure.colorbar(shown, label="caught after 0.5 s")
widest = float((table["trapped_high"] - table["trapped_low"]).max()) / 2
print(f"no interval is wider than ± {widest:.2f}")
assert caught[:, 0].mean() > caught[:, -1].mean()
