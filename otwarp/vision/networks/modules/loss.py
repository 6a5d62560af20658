"""What training makes small: the paper's loss, and the improbability of the true poses."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional

DEPTH_WEIGHT = 0.8
"""Of the normalised depth's mean square error beside the cross entropy of the class."""


def paper_loss(scores: Tensor, depth: Tensor, true_class: Tensor, true_depth: Tensor, *, broadcast: bool) -> Tensor:
    """Cross entropy of the class + 0.8 mean square error of the normalised depth.

    Args:
        scores: (n, classes).
        depth: (n), estimated.
        true_class: (n), −1 for images of no class, which count for depth alone.
        true_depth: (n).
        broadcast: An ablation: compare every estimate with *every* label, as (n, 1) − (n) does where a dimension was
            forgotten. Its least value is reached by the labels' mean, whatever the image.
    """
    error = depth[:, None] - true_depth[None, :] if broadcast else depth - true_depth
    wrong = functional.cross_entropy(scores, true_class, ignore_index=-1, reduction="sum")
    return wrong / torch.sum(true_class >= 0).clamp(min=1) + DEPTH_WEIGHT * torch.mean(error**2)


def residuals(mean: Tensor, truth: Tensor, scale: Tensor, names: tuple[str, ...], *, mirrored: bool) -> Tensor:
    """(g, n, k) truth − mean in units of the scale, for each of the g poses that look the same.

    Args:
        mean, truth: (n, k) [µm, rad].
        scale: (k) [µm, rad].
        names: The k quantities.
        mirrored: Whether a robot whose axis is turned round looks the same: (tilt, yaw) is (−tilt, yaw + 180°) then.
    """
    poses = [truth]
    if mirrored:
        sign, step = torch.ones_like(scale), torch.zeros_like(scale)
        # filled, since a number that is assigned comes from the host, which no graph of CUDA records
        sign[names.index("tilt")].fill_(-1.0)
        step[names.index("yaw")].fill_(math.pi)
        poses.append(truth * sign + step)
    error = torch.stack(poses) - mean
    if "yaw" in names:
        turn = 2.0 * math.pi
        round_the_circle = torch.zeros_like(scale)
        round_the_circle[names.index("yaw")].fill_(turn)
        error = error - round_the_circle * torch.round(error / turn)
    return error / scale


def pose_loss(error: Tensor, factor: Tensor, share: float | Tensor) -> Tensor:
    """Negative logarithm of a normal distribution's density, or half the mean square error to begin with.

    Of the poses that look the same the most probable counts. A covariance that is learnt before the mean is keeps the
    mean from being learnt (Seitzer et al. 2022, arXiv:2203.09168): training begins with the square and ends without.

    Args:
        error: (g, n, k) as of `residuals`.
        factor: (n, k, k) L, whose L Lᵀ is the inverse covariance.
        share: Of the density, 0 to 1; the rest is the square's.
    """
    return torch.mean(torch.min(mixed(error, factor, share), 0).values) / error.shape[-1]


def calibrated_loss(error: Tensor, factor: Tensor) -> Tensor:
    """`pose_loss` of a validation part with standard deviations scaled as they will be in use, each by one factor.

    Without that, of two networks the one that errs more but says so would count as the better one.

    Args:
        error, factor: As of `pose_loss`, of the whole part.
    """
    nearest = torch.argmin(mixed(error, factor, 1.0), 0)
    away = error[nearest, torch.arange(len(nearest), device=error.device)]
    one = torch.eye(factor.shape[-1], dtype=factor.dtype, device=factor.device)
    deviation = torch.linalg.norm(torch.linalg.solve_triangular(factor, one, upper=False), dim=-2)
    widen = torch.sqrt(torch.mean((away / deviation) ** 2, 0))
    return pose_loss(error, factor / widen[:, None], 1.0)


def mixed(error: Tensor, factor: Tensor, share: float | Tensor) -> Tensor:
    """(g, n) of each pose and image, over all quantities; `pose_loss` has the arguments."""
    white = torch.einsum("nij,gni->gnj", factor, error)
    half = torch.sum(torch.log(torch.diagonal(factor, dim1=-2, dim2=-1)), -1)
    density = 0.5 * torch.sum(white**2, -1) - half + 0.5 * error.shape[-1] * math.log(2.0 * math.pi)
    return share * density + (1.0 - share) * 0.5 * torch.sum(error**2, -1)
