"""From one slice to the next in the spectrum: scattered light is added, and all light goes on."""

from __future__ import annotations

import warp as wp


@wp.func
def times(a: wp.vec2f, b: wp.vec2f) -> wp.vec2f:
    """Product a b of two complex numbers, each its real and imaginary part; of the unit of both."""
    return wp.vec2f(a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0])


@wp.func
def conjugate(a: wp.vec2f) -> wp.vec2f:
    """a*: the complex number (real, imaginary) with its imaginary part reversed, in the same unit."""
    return wp.vec2f(a[0], -a[1])


@wp.kernel(enable_backward=False)
def carry(
    carrier: wp.array2d(dtype=wp.vec2f),
    sources: int,
    amplitude: wp.array2d(dtype=wp.vec2f),
    spectrum: wp.array2d(dtype=wp.vec2f),
):
    """spectrum = carrier · amplitude, for (pose and source, component of the spectrum)."""
    r, i = wp.tid()
    spectrum[r, i] = times(carrier[r / sources, i], amplitude[r, i])


@wp.kernel(enable_backward=False)
def add_scattered(
    scattered: wp.array2d(dtype=wp.vec2f),
    gain: wp.array2d(dtype=wp.vec2f),
    carrier: wp.array2d(dtype=wp.vec2f),
    sources: int,
    amplitude: wp.array2d(dtype=wp.vec2f),
):
    """amplitude += gain · carrier* · scattered, for (pose and source, component of the spectrum)."""
    r, i = wp.tid()
    p = r / sources
    amplitude[r, i] += times(times(gain[p, i], conjugate(carrier[p, i])), scattered[r, i])


@wp.kernel(enable_backward=False)
def add_and_carry(
    scattered: wp.array2d(dtype=wp.vec2f),
    gain: wp.array2d(dtype=wp.vec2f),
    carrier: wp.array2d(dtype=wp.vec2f),
    following: wp.array2d(dtype=wp.vec2f),
    sources: int,
    amplitude: wp.array2d(dtype=wp.vec2f),
    spectrum: wp.array2d(dtype=wp.vec2f),
):
    """`add_scattered`, and `carry` by the carrier of the following slice: the amplitude is read once."""
    r, i = wp.tid()
    p = r / sources
    a = amplitude[r, i] + times(times(gain[p, i], conjugate(carrier[p, i])), scattered[r, i])
    amplitude[r, i] = a
    spectrum[r, i] = times(following[p, i], a)


@wp.func_native("""
    const int n = carrier.shape[0];
    const float* __restrict__ c = (const float*)carrier.data;
    const float* __restrict__ g = (const float*)gain.data;
    const float* __restrict__ w = (const float*)scattered.data + 2 * (size_t)source * n;
    float* __restrict__ a = (float*)amplitude.data + 2 * (size_t)source * n;
    for (int i = 0; i < n; ++i) {
        const float re = g[2 * i] * c[2 * i] + g[2 * i + 1] * c[2 * i + 1];
        const float im = g[2 * i + 1] * c[2 * i] - g[2 * i] * c[2 * i + 1];
        a[2 * i] += re * w[2 * i] - im * w[2 * i + 1];
        a[2 * i + 1] += re * w[2 * i + 1] + im * w[2 * i];
    }
""")
def add_scattered_all(
    scattered: wp.array2d(dtype=wp.vec2f),
    gain: wp.array(dtype=wp.vec2f),
    carrier: wp.array(dtype=wp.vec2f),
    amplitude: wp.array2d(dtype=wp.vec2f),
    source: int,
):
    """`add_scattered` for all components of one source, in a CPU's vector registers."""
    ...


@wp.func_native("""
    const int n = carrier.shape[0];
    const float* __restrict__ c = (const float*)carrier.data;
    const float* __restrict__ a = (const float*)amplitude.data + 2 * (size_t)source * n;
    float* __restrict__ v = (float*)spectrum.data + 2 * (size_t)source * n;
    for (int i = 0; i < n; ++i) {
        const float re = c[2 * i] * a[2 * i] - c[2 * i + 1] * a[2 * i + 1];
        const float im = c[2 * i] * a[2 * i + 1] + c[2 * i + 1] * a[2 * i];
        v[2 * i] = re;
        v[2 * i + 1] = im;
    }
""")
def carry_all(
    carrier: wp.array(dtype=wp.vec2f),
    amplitude: wp.array2d(dtype=wp.vec2f),
    spectrum: wp.array2d(dtype=wp.vec2f),
    source: int,
):
    """`carry` for all components of one source, in a CPU's vector registers."""
    ...


@wp.kernel(enable_backward=False)
def add_scattered_by_source(
    scattered: wp.array2d(dtype=wp.vec2f),
    gain: wp.array(dtype=wp.vec2f),
    carrier: wp.array(dtype=wp.vec2f),
    amplitude: wp.array2d(dtype=wp.vec2f),
):
    """`add_scattered` on a CPU: one thread for each source."""
    add_scattered_all(scattered, gain, carrier, amplitude, wp.tid())


@wp.kernel(enable_backward=False)
def carry_by_source(
    carrier: wp.array(dtype=wp.vec2f), amplitude: wp.array2d(dtype=wp.vec2f), spectrum: wp.array2d(dtype=wp.vec2f)
):
    """`carry` on a CPU: one thread for each source."""
    carry_all(carrier, amplitude, spectrum, wp.tid())
