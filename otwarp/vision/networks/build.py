"""A network by its name: the module, and what a file must say to make it again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from otwarp.vision.networks.learnt import learnt_of, seen_all_around
from otwarp.vision.networks.library import torch_library
from otwarp.vision.networks.settings import Settings
from otwarp.vision.networks.targets import Targets


def build(net: str, heads: str, targets: Targets, grey: tuple[float, float]) -> Any:
    """A network with random weights.

    Args:
        net: Name of the backbone.
        heads: As of `Settings`.
        targets: What it is to say.
        grey: Mean and deviation of its images [of full scale].
    """
    torch = torch_library()
    from otwarp.vision.networks.modules.network import Network

    return Network(
        net,
        classes=len(targets.classes) if heads in ("both", "paper") else 0,
        names=targets.names if heads in ("both", "pose") else (),
        offset=torch.tensor(targets.offset),
        scale=torch.tensor(targets.scale),
        grey=grey,
    )


def described(
    settings: Settings, targets: Targets, size: int, dataset: Any, grey: tuple[float, float]
) -> dict[str, Any]:
    """What `build` and estimating need, for a file.

    Args:
        settings: Of the training.
        targets: What the network says.
        size: Side of its images after resizing [pixels].
        dataset: Which it was trained on.
        grey: Mean and deviation of its images [of full scale].
    """
    return {
        "net": settings.net,
        "heads": settings.heads,
        "targets": targets.said(),
        "size": size,
        "shape": [int(n) for n in dataset.shape],
        "pixel": float(dataset.manifest["optics"]["pixel"]),
        "grey": list(grey),
        "bits": int(dataset.manifest["sensor"]["bits"]),
        "robot": dict(dataset.manifest["robot"]),
        "learnt": learnt_of(dataset),
        "same_all_around": seen_all_around(dataset),
    }


def rebuilt(said: Mapping[str, Any]) -> tuple[Any, Targets]:
    """A network as a file describes it, with random weights, and what it says."""
    targets = Targets.read(said["targets"])
    return build(said["net"], said["heads"], targets, (said["grey"][0], said["grey"][1])), targets


def grey_of(images: Any) -> tuple[float, float]:
    """Mean and deviation of images (n, h, w) of uint8, of full scale; of at most 1000 of them."""
    some = images[:: max(1, len(images) // 1000)].float() / 255.0
    return round(float(some.mean()), 6), round(max(float(some.std()), 1e-3), 6)


def parameters(module: Any) -> int:
    """Numbers that training changes or could change."""
    return int(np.sum([p.numel() for p in module.parameters()]))
