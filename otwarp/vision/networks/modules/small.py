"""A small residual network for one grey channel: a tenth of the arithmetic of ResNet18."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from otwarp.vision.networks.modules.resnet import BasicBlock

WIDTHS = (20, 40, 80, 160)
STRIDES = (1, 2, 2, 1)
"""Of the stages. The last does not stride: positions are read off its maps, 1/16 of the image wide."""


class Small(nn.Module):
    """Stem and four stages of residual blocks; all channels are its own, there are no published weights."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Sequential(
            nn.Conv2d(1, WIDTHS[0], 5, 2, padding=2, bias=False),
            nn.BatchNorm2d(WIDTHS[0]),
            nn.ReLU(inplace=True),
            nn.MaxPool2d(3, 2, padding=1),
        )
        stages, inputs = [], WIDTHS[0]
        for width, stride in zip(WIDTHS, STRIDES, strict=True):
            beside = None
            if stride > 1 or inputs != width:
                beside = nn.Sequential(nn.Conv2d(inputs, width, 1, stride, bias=False), nn.BatchNorm2d(width))
            # the widest maps are the dearest: one block of them will do
            blocks = [BasicBlock(inputs, width, stride, beside)]
            blocks += [BasicBlock(width, width, 1, None)] if stride > 1 else []
            stages.append(nn.Sequential(*blocks))
            inputs = width
        self.stages = nn.Sequential(*stages)
        self.width = inputs
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def maps(self, x: Tensor) -> Tensor:
        """(n, 160, h / 16, w / 16) features of (n, 1, h, w) images."""
        return self.stages(self.stem(x))

    def vector(self, maps: Tensor) -> Tensor:
        """(n, 160) means of the maps."""
        return torch.mean(maps, (-2, -1))
