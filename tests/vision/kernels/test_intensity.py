"""Intensities of a condenser's points add up, in both forms."""

from __future__ import annotations

import numpy as np
import warp as wp

from otwarp.vision.kernels.intensity import add_intensities, add_intensity_at_once
from tests.vision.kernels.test_advance import complex_numbers, on_device

PLANES, SOURCES, PIXELS = 2, 5, 41
ROUNDING = 1e-6
"""Relative, of sums of five numbers in float32."""


def test_images_are_weighted_sums_of_squares(device: str):
    rng = np.random.default_rng(6)
    field, weight = complex_numbers(rng, PLANES, SOURCES, PIXELS), rng.random(SOURCES).astype(np.float32)
    before = rng.random((PLANES, PIXELS)).astype(np.float32)
    wanted = before + np.einsum("s,fsi->fi", weight.astype(float), np.abs(field.astype(complex)) ** 2)
    image, share = (wp.array(values, dtype=float, device=device) for values in (before, weight))
    wp.launch(add_intensities, dim=before.shape, inputs=[on_device(field, device), share, image], device=device)
    np.testing.assert_allclose(image.numpy(), wanted, rtol=3 * ROUNDING)
    if wp.get_device(device).is_cpu:
        image = wp.array(before, dtype=float, device=device)
        for n in range(PLANES):
            wp.launch(
                add_intensity_at_once, dim=1, inputs=[on_device(field[n], device), share, image[n]], device=device
            )
        np.testing.assert_allclose(image.numpy(), wanted, rtol=3 * ROUNDING)


def test_a_phase_of_a_source_does_not_matter(device: str):
    """Points of a condenser do not interfere: the phase of each is free."""
    rng = np.random.default_rng(7)
    field, weight = complex_numbers(rng, 1, SOURCES, PIXELS), np.ones(SOURCES, np.float32)
    turned = (field * np.exp(2j * np.pi * rng.random((1, SOURCES, 1)))).astype(np.complex64)
    images = []
    for f in (field, turned):
        image = wp.zeros((1, PIXELS), dtype=float, device=device)
        views = [on_device(f, device), wp.array(weight, dtype=float, device=device), image]
        wp.launch(add_intensities, dim=(1, PIXELS), inputs=views, device=device)
        images.append(image.numpy())
    np.testing.assert_allclose(*images, rtol=10 * ROUNDING)
    assert np.abs(field - turned).max() > 0.1
