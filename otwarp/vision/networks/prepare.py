"""A training before it begins: its parts on the device, a network with its first weights, an optimiser."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.networks import checkpoint
from otwarp.vision.networks.build import build, described, grey_of
from otwarp.vision.networks.data import Samples, samples
from otwarp.vision.networks.estimate import QUANTITIES
from otwarp.vision.networks.library import torch_library
from otwarp.vision.networks.settings import Settings
from otwarp.vision.networks.targets import Targets, targets_of, truth
from otwarp.vision.networks.weights import load_weights

WEIGHT_DECAY = 1e-4
"""Of Adam, as the paper's."""


@dataclass
class Training:
    """One training, between epochs.

    Attributes:
        folder, settings: Where, and how.
        network, optimiser: Of torch.
        targets: What the network says.
        parts: Indices of the data set's training, validation and test part.
        train, validation: On the device.
        stretch: [pixels of the resized image per µm], along x and y.
        change: Generator of the augmentation, on the device.
        weights: Where the network began.
        about: What `network.pt` says beside the weights.
        rows: Learning curves so far.
        kept: Epochs before the last checkpoint.
        checkpoints, pictures: How often where it stands, and its curves, are written.
    """

    folder: Path
    settings: Settings
    network: Any
    optimiser: Any
    targets: Targets
    parts: Mapping[str, np.ndarray]
    train: Samples
    validation: Samples
    stretch: tuple[float, float]
    change: Any
    weights: Mapping[str, str]
    about: Mapping[str, Any]
    rows: list[dict[str, Any]] = field(default_factory=list)
    kept: int = 0
    checkpoints: checkpoint.Seldom = field(default_factory=checkpoint.Seldom)
    pictures: checkpoint.Seldom = field(default_factory=lambda: checkpoint.Seldom(20.0))

    @property
    def device(self) -> Any:
        """Device of torch on which the network is trained."""
        return self.train.images.device


def parts_of(split: Mapping[str, np.ndarray], settings: Settings) -> dict[str, np.ndarray]:
    """The split, its training part as small as is asked."""
    parts = {name: np.asarray(index) for name, index in split.items()}
    if settings.images:
        if settings.images > len(parts["train"]):
            raise InputError(f"images is {settings.images}; allowed: up to {len(parts['train'])}, which the training "
                             f"part of split {settings.split} has")  # fmt: skip
        rng = np.random.default_rng([settings.seed, 3])
        parts["train"] = np.sort(rng.permutation(parts["train"])[: settings.images])
    if len(parts["train"]) < 2:
        raise InputError(
            f"the training part of split {settings.split} has {len(parts['train'])} images; allowed: 2 or more"
        )
    return parts


def dataset_digest(data: Any) -> str:
    """Of a data set: of all that its manifest says."""
    text = json.dumps(data.manifest, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def prepare(data: Any, parts: Mapping[str, np.ndarray], folder: Path, settings: Settings, device: Any) -> Training:
    """Images on the device, a network with its first weights, an optimiser.

    Raises:
        InputError: Heads for which the data set has no labels, or weights of another network.
    """
    torch = torch_library()
    targets = targets_of(
        data.labels, parts["train"], symmetry=data.manifest["symmetry"], classes=np.asarray(data.classes)
    )
    has = bool(np.any(np.asarray(data.labels["tilt_class"])[parts["train"]] >= 0))
    for heads, there in (("paper", has), ("pose", bool(targets.names))):
        if settings.heads == heads and not there:
            raise InputError(f"heads is {heads}, but the training part of the data set has no such labels that vary; "
                             "allowed: the other heads")  # fmt: skip
    size = settings.size or max(data.shape)
    columns = [QUANTITIES.index(name) for name in targets.names]
    on = {part: samples(data, parts[part], truth(data.labels, parts[part])[:, columns], size, device)
          for part in ("train", "validation")}  # fmt: skip
    grey = grey_of(on["train"].images)
    network = build(settings.net, settings.heads, targets, grey)
    weights = load_weights(network.backbone, settings.net, settings.weights)
    if settings.net == "vgg16" and weights["source"] != "none":
        network.backbone.freeze()
    network = network.to(device).to(memory_format=torch.channels_last)
    moving = [p for p in network.parameters() if p.requires_grad]
    optimiser = torch.optim.Adam(moving, lr=settings.rate, weight_decay=WEIGHT_DECAY, fused=True)
    pixel = float(data.manifest["optics"]["pixel"])
    stretch = (size / (data.shape[1] * pixel), size / (data.shape[0] * pixel))
    asked = {"dataset": dataset_digest(data), "settings": settings.said()}
    about = {**described(settings, targets, size, data, grey), "training": checkpoint.digest(asked)}
    return Training(folder, settings, network, optimiser, targets, parts, on["train"], on["validation"], stretch,
                    torch.Generator(device), weights, about)  # fmt: skip
