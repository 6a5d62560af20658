# %% [markdown]
# # How stiff is the trap?
#
# One films a bead and computes the stiffness of its trap from its jiggling. Here the truth is known, so that one sees
# what each method is worth, and what a camera does to it. All data are simulated.

# %%
import matplotlib.pyplot as plt
import numpy as np

import otwarp as ot

TRUE, DRAG, TEMPERATURE = 1.0, 0.0168, 298.15  # pN/µm, pN·s/µm, K
track = ot.analysis.harmonic_tracks([TRUE], drag=DRAG, interval=2.5e-4, samples=2**18, seed=1)
x, time = track.values[0, :, 0], track["time"].values  # µm, s
print(f"{time[-1]:.1f} s, relaxation time {1e3 * DRAG / TRUE:.1f} ms, spread {1e3 * x.std():.1f} nm")

# %% [markdown]
# ## The track, and its spectrum
#
# Above the corner frequency k/(2πγ) the bead diffuses freely, below it the trap holds it.

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
left.plot(time[:4000], 1e3 * x[:4000], lw=0.7)
left.set(xlabel="time [s]", ylabel="x [nm]")
spectrum = ot.analysis.power_spectrum(track, blocks=4, bins=60)
right.loglog(spectrum["frequency"], np.squeeze(spectrum["power"].values), ".")
right.axvline(TRUE / (2 * np.pi * DRAG), color="k", lw=1)
right.set(xlabel="frequency [Hz]", ylabel="power spectrum [µm²/Hz]")

# %% [markdown]
# ## Five methods side by side, with intervals of 95 %

# %%
perfect = ot.analysis.calibrate(track, temperature=TEMPERATURE)
print(perfect[["stiffness_low", "stiffness", "stiffness_high"]].squeeze().to_dataframe().round(3))

# %% [markdown]
# ## As a camera sees it
#
# It exposes for 8 ms, half the relaxation time, over which the bead's motion is averaged. The variance is then too
# small, and a method that takes it for kT/k finds a trap that is too stiff. Told of the detector, the fits allow for
# it.

# %%
camera = ot.analysis.Detector(rate=100.0, exposure=8e-3, noise=0.005)
seen = camera.see(track, seed=2)
naive = ot.analysis.equipartition(seen, temperature=TEMPERATURE)
told = ot.analysis.calibrate(track, temperature=TEMPERATURE, detector=camera)

# %%
bars = [(f"{name}, told", told.sel(estimator=name)) for name in told["estimator"].values]
bars = [("equipartition, not told", naive), *bars]
middle, low, high = (
    np.array([float(np.squeeze(table[f"stiffness{end}"].values)) for _, table in bars]) for end in ("", "_low", "_high")
)
figure, axes = plt.subplots(figsize=(7, 2.8), layout="constrained")
axes.errorbar(middle, range(len(bars)), xerr=[middle - low, high - middle], fmt="o", capsize=3)
axes.axvline(TRUE, color="k", lw=1)
axes.set(yticks=range(len(bars)), yticklabels=[name for name, _ in bars], xlabel="stiffness [pN/µm]")
print(f"not told: {middle[0] / TRUE - 1:+.0%}, told: {middle[1] / TRUE - 1:+.0%}")
assert low[0] > TRUE, "blur should have made the trap look stiffer"
