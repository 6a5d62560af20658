"""From slice to slice of a spectrum, against NumPy's complex numbers, in both forms."""

from __future__ import annotations

import numpy as np
import warp as wp

from otwarp.vision.kernels.advance import add_scattered, add_scattered_by_source, carry, carry_by_source

SOURCES, COMPONENTS = 3, 37
ROUNDING = 3e-6
"""Of products of three numbers of about 1 in float32."""


def complex_numbers(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return (rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(np.complex64)


def on_device(values: np.ndarray, device: str) -> wp.array:
    return wp.array(values.view(np.float32).reshape(*values.shape, 2), dtype=wp.vec2f, device=device)


def on_host(values: wp.array) -> np.ndarray:
    return np.ascontiguousarray(values.numpy()).view(np.complex64)[..., 0]


def test_both_forms_of_a_kernel(device: str):
    rng = np.random.default_rng(4)
    scattered, amplitude = (complex_numbers(rng, SOURCES, COMPONENTS) for _ in range(2))
    gain, carrier = (complex_numbers(rng, COMPONENTS) for _ in range(2))
    forms = [((SOURCES, COMPONENTS), add_scattered, carry)]
    if wp.get_device(device).is_cpu:
        forms.append(((SOURCES,), add_scattered_by_source, carry_by_source))
    added = amplitude + gain * carrier.conj() * scattered
    for dim, add, go_on in forms:
        kept, spectrum = on_device(amplitude, device), on_device(np.zeros_like(amplitude), device)
        views = [on_device(scattered, device), on_device(gain, device), on_device(carrier, device), kept]
        wp.launch(add, dim=dim, inputs=views, device=device)
        np.testing.assert_allclose(on_host(kept), added, atol=30 * ROUNDING)
        wp.launch(go_on, dim=dim, inputs=[on_device(carrier, device), kept, spectrum], device=device)
        np.testing.assert_allclose(on_host(spectrum), carrier * added, atol=100 * ROUNDING)


def test_nothing_is_lost_between_slices_without_scattering(device: str):
    """A carrier is a phase: it keeps the power of every component, and goes back by its conjugate."""
    rng = np.random.default_rng(5)
    amplitude = complex_numbers(rng, SOURCES, COMPONENTS)
    phase = np.exp(2j * np.pi * rng.random(COMPONENTS)).astype(np.complex64)
    there, back = (on_device(np.zeros_like(amplitude), device) for _ in range(2))
    views = [on_device(phase, device), on_device(amplitude, device), there]
    wp.launch(carry, dim=amplitude.shape, inputs=views, device=device)
    np.testing.assert_allclose(np.abs(on_host(there)), np.abs(amplitude), rtol=ROUNDING)
    wp.launch(carry, dim=amplitude.shape, inputs=[on_device(phase.conj(), device), there, back], device=device)
    np.testing.assert_allclose(on_host(back), amplitude, atol=3 * ROUNDING)
    assert np.abs(on_host(there) - amplitude).max() > 0.1
