"""The image of one sphere from Mie's scattering amplitudes: a reference that shares his coefficients alone."""

from __future__ import annotations

import math

import numpy as np

from otwarp.optics.mie import highest_order, mie_coefficients


def amplitudes(cosine: np.ndarray, size: float, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """S₁ and S₂ (Bohren and Huffman 1983, eq. 4.74)."""
    a, b = mie_coefficients(size, ratio, highest_order(size))
    pi, tau = np.zeros((2, len(a) + 1, *cosine.shape))
    pi[1] = 1.0
    for n in range(2, len(a) + 1):
        pi[n] = ((2 * n - 1) * cosine * pi[n - 1] - n * pi[n - 2]) / (n - 1)
    for n in range(1, len(a) + 1):
        tau[n] = n * cosine * pi[n] - (n + 1) * pi[n - 1]
    n = np.arange(1, len(a) + 1)
    share = (2 * n + 1) / (n * (n + 1))
    first = np.tensordot(share * a, pi[1:], 1) + np.tensordot(share * b, tau[1:], 1)
    return first, np.tensordot(share * a, tau[1:], 1) + np.tensordot(share * b, pi[1:], 1)


def sphere_image(
    radius: float,
    index: float,
    *,
    medium: float,
    wavelength: float,
    aperture: float,
    count: int,
    spacing: float,
    focus: np.ndarray,
    source: tuple[float, float],
) -> np.ndarray:
    """(f, count, count) intensity behind a sphere at the origin in unpolarised light from one direction.

    The scattered far field F e^{ikr}/r is the angular spectrum i F/(2π k_z); an aplanatic objective multiplies by
    √cos θ and bends meridional polarisation into the image.
    """
    k = 2 * math.pi * medium / wavelength
    q = 2 * math.pi * np.fft.fftfreq(count, spacing)
    kx, ky = np.meshgrid(q, q)
    across = kx**2 + ky**2
    passed = across <= (2 * math.pi / wavelength * aperture) ** 2
    kz = np.sqrt(np.where(passed, k * k - across, k * k))
    out = np.stack([kx, ky, kz], -1) / k * passed[..., None] + np.array([0, 0, 1.0]) * ~passed[..., None]
    angle = np.arctan2(out[..., 1], out[..., 0])
    meridional = np.stack(
        [out[..., 2] * np.cos(angle), out[..., 2] * np.sin(angle), -np.hypot(out[..., 0], out[..., 1])], -1
    )
    azimuthal = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], -1)
    to = np.array([*source, math.sqrt(k * k - source[0] ** 2 - source[1] ** 2)]) / k
    turn = math.atan2(source[1], source[0])
    along = np.array([to[2] * math.cos(turn), to[2] * math.sin(turn), -math.hypot(to[0], to[1])])
    beside = np.array([-math.sin(turn), math.cos(turn), 0.0])
    first, second = amplitudes(np.clip(out @ to, -1, 1), k * radius, index / medium)
    normal = np.cross(to, out)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = np.where(length > 1e-9, normal / np.maximum(length, 1e-30), beside)
    before, after = np.cross(to, normal), np.cross(out, normal)
    total = np.zeros((len(focus), count, count))
    in_image = np.array([math.cos(turn), math.sin(turn)]), np.array([-math.sin(turn), math.cos(turn)])
    here = np.unravel_index(np.argmin((kx - source[0]) ** 2 + (ky - source[1]) ** 2), kx.shape)
    for polarisation, image in zip((along, beside), in_image, strict=True):
        far = (1j / k) * (
            (second * (before @ polarisation))[..., None] * after
            + (first * (normal @ polarisation))[..., None] * normal
        )
        spectrum = 1j * far / (2 * math.pi * kz[..., None]) * (q[1] - q[0]) ** 2
        radial, round_ = np.sum(spectrum * meridional, -1), np.sum(spectrum * azimuthal, -1)
        field = (
            radial[..., None] * np.stack([np.cos(angle), np.sin(angle)], -1) + round_[..., None] * azimuthal[..., :2]
        )
        field[here] += image
        field = field * np.sqrt(kz / k)[..., None] * passed[..., None]
        for n, z in enumerate(focus):
            planes = np.fft.ifft2(field * np.exp(1j * kz * z)[..., None], axes=(0, 1)) * count**2
            total[n] += np.sum(np.abs(planes) ** 2, axis=-1) / to[2] / 2
    return np.fft.fftshift(total, axes=(1, 2))


def error(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(f) root mean square difference over the reference's root mean square contrast."""
    difference = np.sqrt(np.mean((image - reference) ** 2, axis=(1, 2)))
    return difference / np.sqrt(np.mean((reference - 1.0) ** 2, axis=(1, 2)))
