"""From slice to slice of a spectrum, against NumPy's complex numbers, in both forms."""

from __future__ import annotations

import numpy as np
import warp as wp

from otwarp.vision.kernels.advance import (
    add_and_carry,
    add_scattered,
    add_scattered_by_source,
    carry,
    carry_by_source,
)

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
    added = amplitude + gain * carrier.conj() * scattered
    for one in (True, False) if wp.get_device(device).is_cpu else (False,):
        kept, spectrum = on_device(amplitude, device), on_device(np.zeros_like(amplitude), device)
        dim = SOURCES if one else (SOURCES, COMPONENTS)
        own = [on_device(v if one else v[None], device) for v in (gain, carrier)]
        many = [] if one else [SOURCES]
        wp.launch(add_scattered_by_source if one else add_scattered, dim=dim,
                  inputs=[on_device(scattered, device), *own, *many, kept], device=device)  # fmt: skip
        np.testing.assert_allclose(on_host(kept), added, atol=30 * ROUNDING)
        wp.launch(carry_by_source if one else carry, dim=dim, inputs=[own[1], *many, kept, spectrum], device=device)
        np.testing.assert_allclose(on_host(spectrum), carrier * added, atol=100 * ROUNDING)


def test_each_pose_has_carriers_of_its_own(device: str):
    """Two poses of three sources: adding and going on at once is one after the other."""
    rng = np.random.default_rng(7)
    scattered, amplitude = (complex_numbers(rng, 2 * SOURCES, COMPONENTS) for _ in range(2))
    gain, carrier, following = (complex_numbers(rng, 2, COMPONENTS) for _ in range(3))
    kept, spectrum = on_device(amplitude, device), on_device(np.zeros_like(amplitude), device)
    views = [on_device(v, device) for v in (scattered, gain, carrier, following)]
    wp.launch(add_and_carry, dim=amplitude.shape, inputs=[*views, SOURCES, kept, spectrum], device=device)
    added = amplitude + np.repeat(gain * carrier.conj(), SOURCES, axis=0) * scattered
    np.testing.assert_allclose(on_host(kept), added, atol=30 * ROUNDING)
    np.testing.assert_allclose(on_host(spectrum), np.repeat(following, SOURCES, axis=0) * added, atol=100 * ROUNDING)


def test_nothing_is_lost_between_slices_without_scattering(device: str):
    """A carrier is a phase: it keeps the power of every component, and goes back by its conjugate."""
    rng = np.random.default_rng(5)
    amplitude = complex_numbers(rng, SOURCES, COMPONENTS)
    phase = np.exp(2j * np.pi * rng.random(COMPONENTS)).astype(np.complex64)
    there, back = (on_device(np.zeros_like(amplitude), device) for _ in range(2))
    views = [on_device(phase[None], device), SOURCES, on_device(amplitude, device), there]
    wp.launch(carry, dim=amplitude.shape, inputs=views, device=device)
    np.testing.assert_allclose(np.abs(on_host(there)), np.abs(amplitude), rtol=ROUNDING)
    wp.launch(
        carry, dim=amplitude.shape, inputs=[on_device(phase.conj()[None], device), SOURCES, there, back], device=device
    )
    np.testing.assert_allclose(on_host(back), amplitude, atol=3 * ROUNDING)
    assert np.abs(on_host(there) - amplitude).max() > 0.1
