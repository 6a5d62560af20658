"""What a network says of many images, as NumPy's arrays; the same numbers in training, evaluation and use."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.vision.networks.library import torch_library
from otwarp.vision.networks.targets import Targets

BATCH = 256
"""Images that a network is shown at a time, at most."""


@dataclass(frozen=True, eq=False)
class Predictions:
    """Of n images; what a network has no head for is None.

    Attributes:
        scores: (n, classes) logarithms of the classes' probabilities, up to a constant.
        depth: (n) normalised depths.
        mean: (n, k) of the targets' quantities [µm, rad].
        covariance: (n, k, k) of them.
    """

    scores: np.ndarray | None = None
    depth: np.ndarray | None = None
    mean: np.ndarray | None = None
    covariance: np.ndarray | None = None


def arithmetic(precision: str, device: Any) -> AbstractContextManager[Any]:
    """A context in which torch computes in bf16 where that is asked for.

    Args:
        precision: As of `Settings`.
        device: torch's.
    """
    if precision == "bf16" or (precision == "auto" and device.type == "cuda"):
        torch = torch_library()
        return torch.autocast(device.type, dtype=torch.bfloat16)
    return nullcontext()


def predict(
    network: Any, targets: Targets, images: Any, *, precision: str = "float32", widen: tuple[float, ...] = ()
) -> Predictions:
    """Show images to a network.

    Args:
        network: As of `build`.
        targets: What it says.
        images: uint8 (n, size, size) on its device.
        precision: As of `Settings`.
        widen: As of `gathered`.
    """
    torch = torch_library()
    was = network.training
    network.eval()
    with torch.inference_mode(), arithmetic(precision, images.device):
        found = gathered(lambda some: network(some.float() / 255.0), images, targets, widen)
    network.train(was)
    return found


def gathered(
    look: Callable[[Any], dict[str, Any]], images: Any, targets: Targets, widen: tuple[float, ...] = ()
) -> Predictions:
    """What is said of images, `BATCH` at a time.

    Args:
        look: What a network says of some images.
        images: n of them.
        targets: What it says.
        widen: (k) factors of the standard deviations, as calibration found them; none for 1.
    """
    found: dict[str, list[np.ndarray]] = {}
    for start in range(0, len(images), BATCH):
        for name, value in look(images[start : start + BATCH]).items():
            found.setdefault(name, []).append(value.float().cpu().numpy().astype(float))
    whole = {name: np.concatenate(parts) for name, parts in found.items()}
    if "factor" in whole:
        factor = whole.pop("factor")
        return Predictions(**whole, covariance=covariances(factor, np.array(targets.scale), np.array(widen or 1.0)))
    return Predictions(**whole)


def covariances(factor: np.ndarray, scale: np.ndarray, widen: np.ndarray) -> np.ndarray:
    """(n, k, k) covariances [µm, rad] of L whose L Lᵀ is their inverse in units of the scale.

    Args:
        factor: (n, k, k) L, lower triangular.
        scale: (k) [µm, rad].
        widen: (k) factors of the standard deviations.
    """
    k = factor.shape[-1]
    inverse = np.linalg.solve(factor, np.broadcast_to(np.eye(k), factor.shape))
    spread = inverse * (scale * widen)
    return np.swapaxes(spread, -1, -2) @ spread
