"""A data set's images on a device: grey levels of eight bits, resized once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.vision.networks.library import torch_library

BLOCK = 1024
"""Images read and resized at a time."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Images with their labels, all on one device.

    Attributes:
        images: uint8 (n, size, size).
        truth: float32 (n, k) of the quantities that are learnt [µm, rad].
        tilt_class: int64 (n), −1 where there is none.
        depth: float32 (n) normalised depth.
    """

    images: Any
    truth: Any
    tilt_class: Any
    depth: Any

    def __len__(self) -> int:
        return len(self.images)


def area_weights(count: int, wanted: int) -> np.ndarray:
    """(wanted, count) shares of pixels in the pixels of a resized row: each is the mean of what it covers.

    Where the row becomes longer, it is interpolated linearly.
    """
    if wanted >= count:
        place = (np.arange(wanted) + 0.5) * count / wanted - 0.5
        return np.maximum(0.0, 1.0 - np.abs(np.clip(place, 0, count - 1)[:, None] - np.arange(count)))
    edges = np.arange(wanted + 1) * count / wanted
    low, high = edges[:-1, None], edges[1:, None]
    covered = np.minimum(high, np.arange(count) + 1) - np.maximum(low, np.arange(count))
    return np.maximum(covered, 0.0) * wanted / count


class Resizing:
    """Images of one shape made as large as a network takes them; those that are so large stay as they are.

    Args:
        shape: Height and width of the images [pixels].
        size: Side after resizing [pixels].
        device: torch's.
    """

    def __init__(self, shape: tuple[int, int], size: int, device: Any):
        torch = torch_library()
        self._weights = () if tuple(shape) == (size, size) else tuple(
            torch.from_numpy(area_weights(n, size)).float().to(device) for n in shape)  # fmt: skip

    def __call__(self, images: Any) -> Any:
        """uint8 (n, size, size) of (n, height, width) ones on the device; launches alone, so that graphs hold it."""
        if not self._weights:
            return images
        torch = torch_library()
        from otwarp.vision.networks.modules.network import resized

        # eight bits are more than bf16 holds
        with torch.autocast(images.device.type, enabled=False):
            return resized(images, *self._weights).to(torch.uint8)


def on_device(images: Any, index: np.ndarray, shape: tuple[int, int], size: int, device: Any) -> Any:
    """uint8 (n, size, size) of a data set's images on a device.

    Args:
        images: Function of indices that gives uint8 (k, height, width).
        index: Which.
        shape: Height and width.
        size: Side after resizing [pixels].
        device: torch's.
    """
    torch = torch_library()
    out, resizing = torch.empty(len(index), size, size, dtype=torch.uint8, device=device), Resizing(shape, size, device)
    for start in range(0, len(index), BLOCK):
        some = torch.from_numpy(np.ascontiguousarray(images(index[start : start + BLOCK])))
        out[start : start + BLOCK] = resizing(some.to(device))
    return out


def samples(dataset: Any, index: np.ndarray, truth: np.ndarray, size: int, device: Any) -> Samples:
    """Images of a data set with their labels on a device.

    Args:
        dataset: As `open_dataset` gives it.
        index: (n) which images.
        truth: (n, k) what is to be learnt of them [µm, rad].
        size: Side after resizing [pixels].
        device: torch's.
    """
    torch = torch_library()
    labels = dataset.labels
    return Samples(
        images=on_device(dataset.images, index, tuple(dataset.shape), size, device),
        truth=torch.from_numpy(truth).float().to(device),
        tilt_class=torch.from_numpy(np.asarray(labels["tilt_class"])[index].astype(np.int64)).to(device),
        depth=torch.from_numpy(np.asarray(labels["depth_normalized"])[index].astype(np.float32)).to(device),
    )
