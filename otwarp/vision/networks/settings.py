"""What can be chosen about a training, checked before anything is loaded."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from otwarp.errors import InputError

NETS = ("resnet18", "resnet50", "vgg16", "small")
HEADS = ("both", "paper", "pose")
SCHEDULES = ("cosine", "step")
PRECISIONS = ("auto", "bf16", "float32")
DEPTH_LOSSES = ("right", "broadcast")
SMALLEST, LARGEST = 32, 1024
"""Sides of images [pixels]: features of the deep networks are 1/32 of them wide."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Of a training.

    Attributes:
        net: One of `NETS`.
        heads: `paper` for classes of tilt and normalised depth, `pose` for x, y, depth, tilt, yaw and covariance.
        split: Of the data set, by name.
        epochs: Passes over the training part.
        batch: Images a step.
        size: Side to which images are resized [pixels]; 0 for the data set's own.
        lr: Largest learning rate; 0 for 1e-3, or 1e-4 for a VGG16 from random weights, which does not train at more.
        schedule: `cosine` after a warm-up, or `step` as the paper: a tenth every ten epochs.
        weights: `none`, `imagenet`, or a file of weights.
        augment: Whether images vary in brightness, contrast, noise and place.
        precision: Of the arithmetic; `auto` is bf16 on GPUs and float32 elsewhere.
        depth_loss: `broadcast` repeats an error of the paper's, as an ablation.
        images: Of the training part, at most; 0 for all.
        seed: Of weights, order and augmentation.

    Raises:
        InputError: A value out of its range.
    """

    net: str = "resnet18"
    heads: str = "both"
    split: str = "random"
    epochs: int = 20
    batch: int = 32
    size: int = 0
    lr: float = 0.0
    schedule: str = "cosine"
    weights: str = "none"
    augment: bool = True
    precision: str = "auto"
    depth_loss: str = "right"
    images: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        choices = {"net": NETS, "heads": HEADS, "schedule": SCHEDULES, "precision": PRECISIONS}
        for name, allowed in {**choices, "depth_loss": DEPTH_LOSSES}.items():
            if getattr(self, name) not in allowed:
                raise InputError(f"{name} is {getattr(self, name)!r}; allowed: {', '.join(allowed)}")
        for name, low in {"epochs": 1, "batch": 2, "images": 0, "seed": 0}.items():
            if getattr(self, name) < low:
                raise InputError(f"{name} is {getattr(self, name)}; allowed: {low} or more")
        if self.size and not SMALLEST <= self.size <= LARGEST:
            raise InputError(
                f"size is {self.size} pixels; allowed: {SMALLEST} to {LARGEST}, or 0 for the data set's own"
            )
        if not (math.isfinite(self.lr) and 0.0 <= self.lr <= 1.0):
            raise InputError(f"lr is {self.lr:g}; allowed: above 0, up to 1, or 0 for the network's usual one")
        if self.net == "small" and self.weights == "imagenet":
            raise InputError("weights is imagenet; allowed for small: none, or a file: nobody publishes its weights")

    @property
    def rate(self) -> float:
        """The largest learning rate."""
        return self.lr or (1e-4 if self.net == "vgg16" and self.weights == "none" else 1e-3)

    def factor(self, step: int, steps: int) -> float:
        """Of the learning rate in one of `steps` steps of a pass, counted from the beginning of the training."""
        if self.schedule == "step":
            return 0.1 ** (step // steps // 10)
        whole = steps * self.epochs
        warm = max(1, min(whole // 10, steps))
        if step < warm:
            return (step + 1) / warm
        return 0.5 * (1.0 + math.cos(math.pi * (step - warm) / max(1, whole - warm)))

    def said(self) -> dict[str, Any]:
        """The settings as numbers and texts for a file, from which `read` makes them again."""
        return dataclasses.asdict(self)

    @classmethod
    def read(cls, said: Mapping[str, Any]) -> Settings:
        """The settings of a file that `said` wrote."""
        return cls(**said)
