# %% [markdown]
# # Escapes too rare to wait for
#
# A weak trap loses its bead within seconds, a stronger one in days or years. Forward-flux sampling finds both: it
# counts how often paths leave the middle of the trap, and then, from interface to interface, how many go on before
# they fall back.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot

# %% [markdown]
# ## By waiting
#
# At the two lowest powers beads are gone after some seconds. That much can be simulated as it happens, 200 times at
# once.

# %%
powers = [0.036, 0.06, 0.1, 0.2]  # mW
scene = ot.Scene.load("table_trap")  # a shipped scene, by name
waited = ot.Study(
    scene,
    axes={"trap_power": ot.values(powers[:2], unit="mW")},
    observables=[ot.first_passage()],
    stop=ot.trials(200),
    horizon=20.0,
    seed=3,
)
with tempfile.TemporaryDirectory() as folder:
    direct = waited.run(Path(folder) / "waited")
rate = direct["first_passage_rate"].values  # 1/s
print("mean time to an escape [s], by waiting:", (1 / rate).round(1))

# %% [markdown]
# ## By interfaces
#
# A run starts paths from each interface; pilot runs place these. The rate is a flux times probabilities, and its
# interval comes from the spread of independent runs.

# %%
study = ot.EscapeStudy(
    scene,
    axes={"trap_power": ot.values(powers, unit="mW")},
    runs=6,
    branches=300,
    halved=False,
    seed=7,
)
with tempfile.TemporaryDirectory() as folder:
    table = study.run(Path(folder) / "escape")
for n, power in enumerate(powers):
    at = table["interface_at"].isel(trap_power=n).values
    there = np.isfinite(at)
    share = table["probability"].transpose(..., "trap_power").values[..., n]
    steps = " ".join(f"{p:.2f}" for p in share[np.isfinite(share)])
    print(f"{power:.3f} mW: flux {table['flux'].values[n]:.2f}/s interfaces {there.sum()}, probabilities {steps}")

# %% [markdown]
# ## Both in one picture

# %%
time, low, high = (table[f"escape_time{end}"].values for end in ("", "_low", "_high"))
figure, axes = plt.subplots(figsize=(6.4, 3.4), layout="constrained")
axes.errorbar(powers, time, [time - low, high - time], fmt="o-", capsize=3, label="by interfaces")
axes.plot(powers[:2], 1 / rate, "kx", ms=9, label="by waiting")
axes.axhline(3600, color="0.6", ls=":")
axes.text(powers[0], 4500, "an hour", color="0.4")
axes.set(xlabel="trap power [mW]", ylabel="mean time to an escape [s]", yscale="log")
axes.legend()
print("by interfaces [s]:", [f"{t:.3g}" for t in time])
assert np.all(np.diff(time) > 0) and time[-1] > 3600.0
