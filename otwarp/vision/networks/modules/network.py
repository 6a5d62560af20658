"""A network from grey levels on: normalisation, backbone, heads."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from otwarp.vision.networks.modules.heads import PaperHeads, PoseHead
from otwarp.vision.networks.modules.resnet import resnet18, resnet50
from otwarp.vision.networks.modules.small import Small
from otwarp.vision.networks.modules.vgg import vgg16

BACKBONES = {"resnet18": resnet18, "resnet50": resnet50, "vgg16": vgg16, "small": Small}

IMAGENET = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
"""Mean and deviation of the colours that published weights were trained on."""


class Network(nn.Module):
    """A backbone with the heads that are asked for.

    Args:
        net: Name of the backbone.
        classes: Of tilt; 0 for no heads of the paper's.
        names: Quantities of the pose's head; none for no such head.
        offset, scale: (k) of their labels [µm, rad].
        grey: Mean and deviation of the images [of full scale]; a network of three channels takes `IMAGENET`'s.
    """

    grey: Tensor
    deviation: Tensor

    def __init__(
        self,
        net: str,
        *,
        classes: int,
        names: tuple[str, ...],
        offset: Tensor,
        scale: Tensor,
        grey: tuple[float, float] = (0.5, 0.25),
    ):
        super().__init__()
        self.backbone = BACKBONES[net]()
        width, channels = self.backbone.width, 512 if net == "vgg16" else self.backbone.width
        self.paper = PaperHeads(width, classes) if classes else None
        self.pose = PoseHead(width, channels, names, offset, scale) if names else None
        mean, deviation = ((grey[0],), (grey[1],)) if net == "small" else IMAGENET
        self.register_buffer("grey", torch.tensor(mean)[:, None, None])
        self.register_buffer("deviation", torch.tensor(deviation)[:, None, None])

    def normalised(self, images: Tensor) -> Tensor:
        """(n, channels, h, w) of (n, h, w) grey levels from 0 to 1."""
        colours = (images[:, None] - self.grey) / self.deviation
        return colours.contiguous(memory_format=torch.channels_last)

    def forward(self, images: Tensor) -> dict[str, Tensor]:
        """What the heads say of (n, h, w) grey levels from 0 to 1.

        Returns:
            Of the paper's heads `scores` (n, classes) and `depth` (n); of the pose's `mean` (n, k) [µm, rad] and
            `factor` (n, k, k), as of `PoseHead`.
        """
        maps = self.backbone.maps(self.normalised(images))
        vector = self.backbone.vector(maps)
        said: dict[str, Tensor] = {}
        if self.paper is not None:
            said["scores"], said["depth"] = self.paper(vector)
        if self.pose is not None:
            # positions in µm and covariances need more digits than bf16 has
            with torch.autocast(images.device.type, enabled=False):
                said["mean"], said["factor"] = self.pose(vector.float(), maps.float())
        return said


def resized(images: Tensor, rows: Tensor, columns: Tensor) -> Tensor:
    """(n, H, W) whole grey levels of (n, h, w) ones: each pixel the mean of those that it covers.

    Args:
        images: 0 to 255.
        rows, columns: (H, h) and (W, w) weights, as of `area_weights`.
    """
    return torch.round(rows @ images.float() @ columns.transpose(-2, -1))


class Exported(nn.Module):
    """A network as a file of ONNX has it: from whole images to covariances.

    Args:
        network: Trained.
        rows, columns: Weights of `resized`.
        widen: (k) factors of the standard deviations.
        resize: Whether images are resized at all.
    """

    rows: Tensor
    columns: Tensor
    spread: Tensor

    def __init__(self, network: Network, rows: Tensor, columns: Tensor, widen: Tensor, *, resize: bool):
        super().__init__()
        self.network, self.resize = network, resize
        self.register_buffer("rows", rows)
        self.register_buffer("columns", columns)
        self.register_buffer("spread", widen * network.pose.scale if network.pose is not None else widen)
        paper = ("scores", "depth") if network.paper is not None else ()
        self.names = paper + (("mean", "covariance") if network.pose is not None else ())

    def forward(self, images: Tensor) -> tuple[Tensor, ...]:
        """What `names` says of (n, height, width) uint8."""
        small = resized(images, self.rows, self.columns) if self.resize else images.float()
        said = self.network(small / 255.0)
        if "factor" in said:
            inverse = _inverse(said.pop("factor")) * self.spread
            said["covariance"] = inverse.transpose(-2, -1) @ inverse
        return tuple(said[name] for name in self.names)


def _inverse(factor: Tensor) -> Tensor:
    """(n, k, k) inverses of lower triangular matrices, by substitution: k is at most five."""
    k = factor.shape[-1]
    rows: list[list[Tensor]] = []
    zero = torch.zeros_like(factor[:, 0, 0])
    for i in range(k):
        row = [zero] * k
        row[i] = 1.0 / factor[:, i, i]
        for j in range(i):
            total = zero
            for m in range(j, i):
                total = total + factor[:, i, m] * rows[m][j]
            row[j] = -total * row[i]
        rows.append(row)
    return torch.stack([torch.stack(row, 1) for row in rows], 1)
