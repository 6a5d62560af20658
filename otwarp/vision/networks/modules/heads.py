"""Heads: the paper's classes and normalised depth, and a pose with its covariance."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from otwarp.vision.networks.estimate import QUANTITIES

HIDDEN = 256
POINTS = 16
"""Maps whose middles of mass a pose is read from beside the means of all maps."""

STEEPEST = 9.0
"""Largest logarithm of a standard deviation's inverse, in units of the labels' spread."""


class PaperHeads(nn.Module):
    """A class of tilt and a depth from 0 to 1, each by Linear–ReLU–Dropout–Linear of a vector of features.

    Args:
        width: Features.
        classes: Of tilt.
    """

    def __init__(self, width: int, classes: int):
        super().__init__()
        self.pose = _head(width, classes)
        self.depth = _head(width, 1)

    def forward(self, vector: Tensor) -> tuple[Tensor, Tensor]:
        """(n, classes) scores and (n) normalised depths of (n, width) features."""
        return self.pose(vector), self.depth(vector)[:, 0]


def _head(width: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(width, HIDDEN), nn.ReLU(), nn.Dropout(0.5), nn.Linear(HIDDEN, outputs))


class PoseHead(nn.Module):
    """Some of x, y, depth, tilt and yaw as a normal distribution with a full covariance.

    Yaw is the direction of a vector in the plane, so that it has no end. The inverse covariance is L Lᵀ in units of
    the labels' spread; the diagonal of L is positive as an exponential.

    Args:
        width: Features of the vector.
        channels: Of the maps, whose middles of mass (Levine et al. 2016, arXiv:1504.00702) tell positions that a
            mean over the maps forgets.
        names: Which of `QUANTITIES`, k of them.
        offset: (k) middle of the labels [µm, rad].
        scale: (k) their spread [µm, rad].
    """

    offset: Tensor
    scale: Tensor

    def __init__(self, width: int, channels: int, names: tuple[str, ...], offset: Tensor, scale: Tensor):
        super().__init__()
        self.names = tuple(q for q in QUANTITIES if q in names)
        k = len(self.names)
        self.yaw = self.names.index("yaw") if "yaw" in self.names else -1
        self.points = nn.Conv2d(channels, POINTS, 1)
        self.trunk = nn.Sequential(nn.Linear(width + 2 * POINTS, HIDDEN), nn.ReLU())
        self.middle = nn.Linear(HIDDEN, k + (self.yaw >= 0))
        self.spread = nn.Linear(HIDDEN, k * (k + 1) // 2)
        self.register_buffer("offset", offset.float())
        self.register_buffer("scale", scale.float())
        nn.init.zeros_(self.spread.weight)
        nn.init.zeros_(self.spread.bias)
        rows, columns = torch.tril_indices(k, k, -1)
        # place of each number of `spread` in L, row by row: the diagonal first
        place = torch.cat([torch.arange(k) * (k + 1), rows * k + columns])
        self.register_buffer("place", torch.nn.functional.one_hot(place, k * k).float(), persistent=False)

    def forward(self, vector: Tensor, maps: Tensor) -> tuple[Tensor, Tensor]:
        """(n, k) means [µm, rad] and (n, k, k) lower triangular L of (n, width) features and (n, channels, h, w) maps.

        The covariance is that of (quantity − mean) / `scale`, the inverse of L Lᵀ.
        """
        trunk = self.trunk(torch.cat([vector, self._middles(maps)], 1))
        raw = self.middle(trunk)
        k = len(self.names)
        if self.yaw >= 0:
            angle = torch.atan2(raw[:, self.yaw], 1.0 + raw[:, k])
            parts = [self.scale[n] * raw[:, n] if n != self.yaw else angle for n in range(k)]
            mean = self.offset + torch.stack(parts, 1)
        else:
            mean = self.offset + self.scale * raw
        spread = self.spread(trunk)
        steep = torch.clamp(spread[:, :k], -STEEPEST, STEEPEST)
        numbers = torch.cat([torch.exp(steep), spread[:, k:]], 1)
        return mean, (numbers @ self.place).reshape(-1, k, k)  # type: ignore[operator]

    def _middles(self, maps: Tensor) -> Tensor:
        """(n, 2 POINTS) middles of mass of maps made positive, from −1 to 1 across the image."""
        points = self.points(maps)
        n, count, height, width = points.shape
        mass = torch.softmax(points.reshape(n, count, height * width), -1).reshape(n, count, height, width)
        y = torch.linspace(-1.0, 1.0, height, device=maps.device, dtype=mass.dtype)
        x = torch.linspace(-1.0, 1.0, width, device=maps.device, dtype=mass.dtype)
        return torch.cat([(mass.sum(2) * x).sum(-1), (mass.sum(3) * y).sum(-1)], 1)
