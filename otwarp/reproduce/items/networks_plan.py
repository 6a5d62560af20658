"""What of the networks' table is computed: the data set, the trainings, in full and in minutes on a CPU."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.vision.networks import Settings

SPLITS = {"random": "random frames, as published", "focus_blocks": "blocks of focus, nothing leaks"}
"""Splits of the data set, and what they are."""

LAYOUT = """
scene = {scene}
body = "/World/robot"
seed = 7

[image]
width = {width}

[tilts]
classes = {{ from = 0, to = 90, count = {tilts} }}
between = {between}

[depth]
from = -10
to = 10
count = {count}
between_count = {between_count}

[optics]
pixel = {pixel}

{render}[domain]
x = {{ from = -0.4, to = 0.4 }}
y = {{ from = -0.4, to = 0.4 }}

[splits]
random = {random}
focus_blocks = {{ blocks = {blocks}, gap = {gap} }}
{more}"""
"""A data set in TOML."""

FULL_LAYOUT: dict[str, Any] = {"width": 224, "tilts": 19, "between": 1, "count": 300, "between_count": 50,
                               "pixel": 0.065, "render": "", "random": [200, 50, 50], "blocks": 12, "gap": 2,
                               "more": "unseen_tilts = true\n"}  # fmt: skip
"""That of `vision/paper.toml`, which the package does not bring: 5,700 images of 19 tilts, and some between them."""

QUICK_LAYOUT: dict[str, Any] = {"width": 128, "tilts": 19, "between": 0, "count": 30, "between_count": 0,
                                "pixel": 0.11375, "render": "[render]\nrings = 2\nmargin = 6\n",
                                "random": [20, 5, 5], "blocks": 6, "gap": 1, "more": ""}  # fmt: skip
"""570 images of the same field of view and tilts, with larger pixels and fewer focal positions."""

PUBLISHED: dict[str, Any] = {"heads": "paper", "schedule": "step", "augment": False}
"""The published recipe: two heads, cross entropy + 0.8 square error, Adam at 1e-3, a tenth every ten epochs."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The trainings of a report.

    Attributes:
        layout: Of `LAYOUT`.
        networks: Name → settings of `Settings`, without split, seed and weights.
        seeds: Trainings of each network on each split.
        ablation: Name of the network that is trained with the published error of the depth's loss as well.
        said: What it is, in words.
        reduced: Whether it is less than the paper's, and says so wherever it is shown.
    """

    layout: dict[str, Any]
    networks: dict[str, dict[str, Any]]
    seeds: int
    ablation: str
    said: str
    reduced: bool = False


FULL = Plan(
    layout=FULL_LAYOUT,
    networks={net: {**PUBLISHED, "net": net, "epochs": 20, "batch": 32} for net in ("vgg16", "resnet18", "resnet50")},
    seeds=5,
    ablation="resnet18",
    said="224 pixels, 19 tilts × 300 focal positions, 20 epochs, five seeds",
)
QUICK = Plan(
    layout=QUICK_LAYOUT,
    networks={
        "resnet18": {**PUBLISHED, "net": "resnet18", "epochs": 5, "batch": 16, "size": 64},
        "small": {**PUBLISHED, "net": "small", "epochs": 20, "batch": 8, "lr": 3e-3, "size": 64},
    },
    seeds=1,
    ablation="small",
    said="reduced: 64 pixels, 19 tilts × 30 focal positions, 5 (ResNet18) and 20 epochs (small), one seed",
    reduced=True,
)


def write_layout(plan: Plan, scene: Path, file: Path) -> Path:
    """Write the data set of a plan as a file.

    Args:
        plan: Which.
        scene: `strategy_b.usda`, whose robot and optics it has.
        file: Where.
    """
    path = '"' + str(scene.absolute()).replace("\\", "/") + '"'
    file.write_text(LAYOUT.format(scene=path, **plan.layout), encoding="utf-8")
    return file


def settings_of(plan: Plan, name: str, *, split: str, seed: int, depth_loss: str = "right") -> Settings:
    """Of a training; weights are ImageNet's where the user has their file, and the result says which they were."""
    how = plan.networks[name]
    return Settings(**how, split=split, seed=seed, depth_loss=depth_loss, weights=weights_of(how["net"]))


def weights_of(net: str) -> str:
    """`imagenet` where torchvision's file is in torch's cache, else `none`."""
    from otwarp.vision.networks.weights import FILES, find_weights

    try:
        return "imagenet" if net in FILES and find_weights(net, "imagenet") else "none"
    except InputError:
        return "none"
