"""VGG16 (Simonyan and Zisserman 2015, arXiv:1409.1556), with the key names and shapes of torchvision's."""

from __future__ import annotations

import torch
from torch import Tensor, nn

WIDTHS = (64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512, 0)
"""Outputs of the convolutions in order; 0 is a maximum over 2 × 2."""

FROZEN = 10
"""Layers of `features` that the paper leaves as they are when it begins from trained weights."""


class VGG(nn.Module):
    """Thirteen convolutions and three linear layers: 138.36 million parameters in 32 tensors.

    Args:
        classes: Of its last layer, which heads of other kinds leave unused.
    """

    def __init__(self, classes: int = 1000):
        super().__init__()
        layers: list[nn.Module] = []
        inputs = 3
        for width in WIDTHS:
            if width:
                layers += [nn.Conv2d(inputs, width, 3, padding=1), nn.ReLU(inplace=True)]
                inputs = width
            else:
                layers.append(nn.MaxPool2d(2, 2))
        self.features = nn.Sequential(*layers)
        self.width = 4096
        self.classifier = nn.Sequential(
            nn.Linear(512 * 7 * 7, 4096), nn.ReLU(inplace=True), nn.Dropout(0.5),
            nn.Linear(4096, 4096), nn.ReLU(inplace=True), nn.Dropout(0.5),
            nn.Linear(4096, classes),
        )  # fmt: skip
        for module in self.modules():
            # without it nothing arrives at the last layers: there is no normalisation between them
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")
                nn.init.zeros_(module.bias)  # type: ignore[arg-type]
            elif isinstance(module, nn.Linear):
                nn.init.normal_(module.weight, 0.0, 0.01)
                nn.init.zeros_(module.bias)

    def maps(self, x: Tensor) -> Tensor:
        """(n, 512, h / 32, w / 32) features of (n, 3, h, w) images."""
        return self.features(x)

    def vector(self, maps: Tensor) -> Tensor:
        """(n, 4096) of the maps: the classifier without its last layer."""
        return self.classifier[:-1](_resampled(maps))

    def forward(self, x: Tensor) -> Tensor:
        """(n, classes) scores of (n, 3, h, w) images."""
        return self.classifier[-1](self.vector(self.maps(x)))

    def freeze(self) -> None:
        """Leave the first `FROZEN` layers as they are."""
        for parameter in self.features[:FROZEN].parameters():
            parameter.requires_grad_(False)


def _resampled(maps: Tensor) -> Tensor:
    """(n, 512 · 7 · 7): means over 7 × 7 fields as `AdaptiveAvgPool2d` takes them, whose gradient on CUDA adds in
    any order; two matrices give the same numbers in a fixed one."""
    rows, columns = (_fields(n, 7, maps) for n in maps.shape[-2:])
    return torch.flatten(rows @ maps @ columns.transpose(-2, -1), 1)


def _fields(count: int, fields: int, like: Tensor) -> Tensor:
    """(fields, count) weights of the mean over each of the fields."""
    edges = [(k * count // fields, -(-(k + 1) * count // fields)) for k in range(fields)]
    weights = torch.zeros(fields, count, dtype=like.dtype, device=like.device)
    for k, (low, high) in enumerate(edges):
        weights[k, low:high] = 1.0 / (high - low)
    return weights


def vgg16() -> VGG:
    """The network of sixteen layers."""
    return VGG()
