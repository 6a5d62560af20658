"""Through the objective, and intensities of the points of a condenser, summed: they do not interfere."""

from __future__ import annotations

import warp as wp

from otwarp.vision.kernels.advance import times


@wp.kernel(enable_backward=False)
def pass_objective(
    spectrum: wp.array2d(dtype=wp.vec2f),
    lens: wp.array2d(dtype=wp.vec2f),
    first: int,
    planes: int,
    sources: int,
    b: int,
    m: int,
    behind: wp.array2d(dtype=wp.vec2f),
):
    """behind = lens · spectrum, for (image from the first on, source, component of m × m), 0 beyond the first b × b.

    Images are those of every pose in all planes, the poses (of `sources` spectra each) one after the other.
    """
    c, s, t = wp.tid()
    pose = (first + c) / planes
    plane = (first + c) - pose * planes
    row = t / m
    column = t - row * m
    value = wp.vec2f(0.0, 0.0)
    if row < b and column < b:
        i = row * b + column
        value = times(spectrum[pose * sources + s, i], lens[plane, i])
    behind[c * sources + s, t] = value


@wp.kernel(enable_backward=False)
def add_intensities(field: wp.array3d(dtype=wp.vec2f), weight: wp.array(dtype=float), image: wp.array2d(dtype=float)):
    """image += Σ weight · |field|² over sources, for (plane, pixel) of fields (plane, source, pixel)."""
    f, i = wp.tid()
    total = float(0.0)
    for s in range(field.shape[1]):
        total += weight[s] * wp.length_sq(field[f, s, i])
    image[f, i] += total


@wp.func_native("""
    const int n = image.shape[0];
    const int sources = field.shape[0];
    float* __restrict__ out = (float*)image.data;
    for (int s = 0; s < sources; ++s) {
        const float share = ((const float*)weight.data)[s];
        const float* __restrict__ e = (const float*)field.data + 2 * (size_t)s * n;
        for (int i = 0; i < n; ++i)
            out[i] += share * (e[2 * i] * e[2 * i] + e[2 * i + 1] * e[2 * i + 1]);
    }
""")
def add_intensity_all(field: wp.array2d(dtype=wp.vec2f), weight: wp.array(dtype=float), image: wp.array(dtype=float)):
    """`add_intensities` of one plane, for all pixels, in a CPU's vector registers."""
    ...


@wp.kernel(enable_backward=False)
def add_intensity_at_once(
    field: wp.array2d(dtype=wp.vec2f), weight: wp.array(dtype=float), image: wp.array(dtype=float)
):
    """`add_intensities` of one plane on a CPU: one thread for all pixels."""
    add_intensity_all(field, weight, image)
