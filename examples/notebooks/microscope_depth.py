# %% [markdown]
# # The microscope, and what limits depth
#
# Robots are transparent: an image is what they do to light. How well can one image say how deep a sphere lies? The
# answer is in how much the image changes with depth, against the noise of photons (the bound of Cramér and Rao). All
# images are simulated.

# %%
import matplotlib.pyplot as plt
import numpy as np

from otwarp.vision import Microscope, Specimen, expose

OPTICS = Microscope(numerical_aperture=1.2, condenser_aperture=0.4)
PIXELS, PHOTONS = 96, 5000  # of a side; photoelectrons of a pixel without specimen

# %% [markdown]
# ## One sphere, many planes
#
# Light is led through the specimen once; focal planes are then cheap.

# %%
sphere = Specimen.of_spheres([[0.0, 0.0, 0.0]], 1.0, 1.45)  # radius [µm], index
light = expose(sphere, OPTICS, PIXELS)
planes = np.linspace(-6.0, 6.0, 61)  # µm
stack = light.images(planes)
figure, axes = plt.subplots(1, 5, figsize=(10, 2.5), layout="constrained")
for axis, n in zip(axes, (0, 20, 30, 40, 60), strict=True):
    axis.imshow(stack[n], cmap="gray", origin="lower", vmin=0.2, vmax=1.8)
    axis.set(title=f"focus {planes[n]:+.0f} µm", xticks=[], yticks=[])

# %% [markdown]
# ## How an image changes with depth
#
# The profile through the middle, over the focal plane: dark below, bright above. Far away little changes.

# %%
middle = PIXELS // 2
width = OPTICS.pixel * PIXELS / 2
figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
shown = axes.imshow(
    stack[:, middle].T, cmap="gray", origin="lower", aspect="auto", extent=(planes[0], planes[-1], -width, width)
)
axes.set(xlabel="focal plane [µm]", ylabel="x [µm]")
figure.colorbar(shown, label="intensity")

# %% [markdown]
# ## The bound
#
# With Poisson noise of N·I in each pixel no unbiased estimate of z has a smaller variance than 1 / Σ N (∂I/∂z)² / I,
# even where all else is known. Two objectives gather different angles: near focus the wider one sees depth better.
# Where the sphere focuses light most brightly its image changes least, and so does one that is far away.

# %%
figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
bounds = {}
for aperture in (0.7, 1.2):
    lens = Microscope(numerical_aperture=aperture, condenser_aperture=0.4)
    seen = expose(sphere, lens, PIXELS).images(planes)
    slope = np.gradient(seen, planes, axis=0)
    bounds[aperture] = 1 / np.sqrt((PHOTONS * slope**2 / np.maximum(seen, 1e-6)).sum(axis=(1, 2)))
    axes.semilogy(planes, 1e3 * bounds[aperture], label=f"aperture {aperture}")
axes.set(xlabel="focal plane [µm]", ylabel="least error of depth [nm]")
axes.legend()
best = {aperture: f"{1e3 * b.min():.2f}" for aperture, b in bounds.items()}
print(f"at best, by aperture, with {PHOTONS} photons a pixel [nm]: {best}")
assert np.median(bounds[1.2]) < np.median(bounds[0.7])
