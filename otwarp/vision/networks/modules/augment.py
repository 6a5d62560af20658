"""Images that another camera might have taken of the same robot: made on the device, from a generator with a seed."""

from __future__ import annotations

import torch
from torch import Tensor

GAIN, OFFSET, NOISE = 0.15, 0.03, 0.03
"""Largest change of contrast, of brightness (of full scale), and standard deviation of noise (of full scale)."""

SHIFT = 0.04
"""Largest shift along each side, of the side."""


def augmented(images: Tensor, generator: torch.Generator, *, shift: bool = True) -> tuple[Tensor, Tensor]:
    """Images of other gain, brightness and noise, and shifted by whole pixels, edges repeated.

    Args:
        images: (n, h, w) from 0 to 1.
        generator: On the device of the images.
        shift: Whether to shift as well.

    Returns:
        (n, h, w) images from 0 to 1, and (n, 2) shifts along x and y [pixels].
    """
    n, height, width = images.shape
    draw = torch.rand(n, 5, generator=generator, device=images.device)
    ways = 2.0 * draw[:, 3:] - 1.0
    steps = torch.round(torch.stack((SHIFT * width * ways[:, 0], SHIFT * height * ways[:, 1]), 1))
    if not shift:
        steps = torch.zeros_like(steps)
    moved = _shifted(images, steps.long())
    gain, offset, noise = 1.0 + GAIN * (2.0 * draw[:, 0] - 1.0), OFFSET * (2.0 * draw[:, 1] - 1.0), NOISE * draw[:, 2]
    white = torch.randn(images.shape, generator=generator, device=images.device)
    changed = moved * gain[:, None, None] + offset[:, None, None] + noise[:, None, None] * white
    return changed.clamp_(0.0, 1.0), steps


def _shifted(images: Tensor, steps: Tensor) -> Tensor:
    """(n, h, w) images moved right and up by (n, 2) whole pixels."""
    n, height, width = images.shape
    columns = (torch.arange(width, device=images.device) - steps[:, :1]).clamp_(0, width - 1)
    rows = (torch.arange(height, device=images.device) - steps[:, 1:]).clamp_(0, height - 1)
    each = torch.arange(n, device=images.device)[:, None, None]
    return images[each, rows[:, :, None], columns[:, None, :]]
