"""What a recording holds of a closed loop: looks and turns as JSON, bit for bit, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from otwarp.perception.camera import Piece
from otwarp.perception.estimator import BodyLook, Look
from otwarp.perception.followed import FollowedBody
from otwarp.vision.tracking.measurement import Measurement

STAMPS = ("number", "time", "exposure", "made", "sent", "read", "crop", "estimate", "done")
"""Of a look: fields that are numbers."""


def look_to_dict(look: Look) -> dict[str, Any]:
    """A look without its images."""
    return {name: getattr(look, name) for name in STAMPS} | {"bodies": [_body_to_dict(one) for one in look.bodies]}


def look_from_dict(told: Mapping[str, Any], images: Sequence[np.ndarray]) -> Look:
    """Back, with the images of its bodies in their order."""
    bodies = tuple(_body_from_dict(one, image) for one, image in zip(told["bodies"], images, strict=True))
    return Look(**{name: told[name] for name in STAMPS}, bodies=bodies)


def _body_to_dict(one: BodyLook) -> dict[str, Any]:
    high, wide = one.piece.levels.shape
    return {
        "body": one.body, "left": one.piece.left, "low": one.piece.low, "height": high, "width": wide,
        "guess": None if one.guess is None else one.guess.tolist(), "why": one.why, "failed": one.failed,
        "seen": None if one.seen is None else measurement_to_dict(one.seen),
    }  # fmt: skip


def _body_from_dict(told: Mapping[str, Any], image: np.ndarray) -> BodyLook:
    guess, seen = told["guess"], told["seen"]
    return BodyLook(
        body=told["body"], piece=Piece(told["left"], told["low"], image), why=told["why"],
        failed=told.get("failed", False),  # recordings of before it was told have none
        guess=None if guess is None else np.array(guess), seen=None if seen is None else measurement_from_dict(seen),
    )  # fmt: skip


def measurement_to_dict(seen: Measurement) -> dict[str, Any]:
    """A measurement."""
    arrays = ("position", "covariance", "axis", "orientation", "frame")
    found: dict[str, Any] = {"time": seen.time, "mirror": float(seen.mirror)}
    for name in arrays:
        value = getattr(seen, name)
        found[name] = None if value is None else np.asarray(value, dtype=float).tolist()
    return found


def measurement_from_dict(told: Mapping[str, Any]) -> Measurement:
    """Back."""
    values: dict[str, Any] = {name: np.array(v) if isinstance(v, list) else v for name, v in told.items()}
    return Measurement(**values)


def body_to_dict(body: FollowedBody) -> dict[str, Any]:
    """Where a body is, and whether it is seen."""
    pose = body.pose
    place, turn = (None, None) if pose is None else (pose.position.tolist(), pose.orientation.tolist())
    return {"body": body.index, "why": body.why, "position": place, "orientation": turn}


def same(first: object, again: object) -> bool:
    """Whether two values of JSON are the same bits; every nan is the same one."""
    if isinstance(first, Mapping) and isinstance(again, Mapping):
        return first.keys() == again.keys() and all(same(first[k], again[k]) for k in first)
    if isinstance(first, list | tuple) and isinstance(again, list | tuple):
        return len(first) == len(again) and all(same(a, b) for a, b in zip(first, again, strict=True))
    if isinstance(first, float) and isinstance(again, float):
        return first == again or (first != first and again != again)
    return first == again
