"""Which images train, which validate and which test: at random, as is usual, and in ways that leak nothing.

    random = [200, 50, 50]                      images of every class; or shares that sum to 1
    focus_blocks = { blocks = 12, gap = 2 }     whole blocks of the focus sweep, the same in every pose; `gap` images on
                                                either side of where blocks of two parts meet are not used
    unseen_tilts = true                         tests on the tilts between classes, or where there are none on every
                                                third class
    unseen_robots = true                        tests on robots that neither train nor validate

In a random split an image that tests has neighbours of the same sweep that train, a fraction of a µm away: that is the
published way, and it says little about a robot that is new. Other splits have the shares of the random one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.datasets.domain import generator, number, whole

if TYPE_CHECKING:
    from otwarp.vision.datasets.spec import Spec

PARTS = ("train", "validation", "test")
"""What 0, 1 and 2 stand for in labels of splits; -1: not used."""
UNUSED = -1
USUAL = (2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0)
"""Shares where nothing is said: 200, 50 and 50 of 300."""


def split_labels(spec: Spec, arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """(n) int8 of every split that was asked for: 0 train, 1 validation, 2 test, -1 unused.

    Raises:
        InputError: A part of one is empty, or its options are not allowed.
    """
    found = {}
    for name, how in spec.splits.items():
        part = _SPLITS[name](spec, arrays, how).astype(np.int8)
        for n, what in enumerate(PARTS):
            if not np.any(part == n):
                raise InputError(f"splits, {name}, leaves nothing for {what}; allowed: images in every part")
        found[f"split_{name}"] = part
    return found


def _random(spec: Spec, arrays: Mapping[str, np.ndarray], how: Any) -> np.ndarray:
    kind = arrays["tilt_class"]
    part, rng = np.full(len(kind), UNUSED), generator(spec.seed, "split random")
    for c in range(len(spec.classes)):
        rows = np.flatnonzero(kind == c)
        rng.shuffle(rows)
        ends = np.cumsum(_counts(how, len(rows)))
        for n, mine in enumerate(np.split(rows, ends)[:3]):
            part[mine] = n
    return part


def _counts(how: Any, images: int) -> np.ndarray:
    """(3) images of a class in each part."""
    allowed = f"three whole numbers of together at most {images} images of a class, or three shares of together 1"
    if not isinstance(how, list) or len(how) != 3:
        raise InputError(f"splits, random, is {how!r}; allowed: {allowed}")
    values = np.array([number(v, "splits, random,", 0.0) for v in how])
    if abs(values.sum() - 1.0) < 1e-6:
        first = np.rint(values[:2] * images).astype(int)
        return np.append(first, images - first.sum())
    if values.sum() > images or np.any(values != np.rint(values)):
        raise InputError(f"splits, random, is {how!r}; allowed: {allowed}")
    return values.astype(int)


def _shares(spec: Spec) -> np.ndarray:
    """(3) of the random split, or the usual ones."""
    how = spec.splits.get("random")
    values = np.array(how, dtype=float) if isinstance(how, list) and len(how) == 3 else np.array(USUAL)
    return values / values.sum()


def _deal(groups: int, shares: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(groups) parts in random order, by shares, each part with at least one where there are three."""
    test, validation = (max(1, round(share * groups)) for share in (shares[2], shares[1]))
    part = np.zeros(groups, dtype=int)
    part[:test], part[test : test + validation] = 2, 1
    rng.shuffle(part)
    return part


def _focus_blocks(spec: Spec, arrays: Mapping[str, np.ndarray], how: Any) -> np.ndarray:
    if not isinstance(how, Mapping) or not set(how) <= {"blocks", "gap"}:
        raise InputError(f"splits, focus_blocks, is {how!r}; allowed: {{ blocks = 12, gap = 2 }}")
    blocks = whole(how.get("blocks"), "splits, focus_blocks, blocks,", 3, 10_000)
    gap = whole(how.get("gap", 0), "splits, focus_blocks, gap,", 0, 10_000)
    low, high = spec.depth
    if high <= low:
        raise InputError(
            "splits, focus_blocks, is of a sweep without length; allowed: depth from one height to another"
        )
    of = _deal(blocks, _shares(spec), generator(spec.seed, "split focus_blocks"))
    place = (arrays["depth"] - low) / (high - low) * blocks
    block = np.clip(place.astype(int), 0, blocks - 1)
    part = of[block]
    # images closer to a border between two parts than `gap` steps of the sweep are left out
    near = gap * blocks / max(spec.count - 1, 1)
    for other in (block - 1, block + 1):
        there = (other >= 0) & (other < blocks)
        border = np.maximum(block, other)
        differs = there & (of[np.clip(other, 0, blocks - 1)] != of[block])
        part = np.where(differs & (np.abs(place - border) < near), UNUSED, part)
    return np.where(arrays["tilt_class"] >= 0, part, UNUSED)


def _unseen_tilts(spec: Spec, arrays: Mapping[str, np.ndarray], how: Any) -> np.ndarray:
    _flag(how, "unseen_tilts")
    kind, rng = arrays["tilt_class"], generator(spec.seed, "split unseen_tilts")
    tested = kind < 0 if np.any(kind < 0) else kind % 3 == 1
    part = np.where(tested, 2, 0)
    shares = _shares(spec)
    for c in np.unique(kind[~tested]):
        rows = np.flatnonzero(kind == c)
        rng.shuffle(rows)
        part[rows[: round(len(rows) * shares[1] / (shares[0] + shares[1]))]] = 1
    return part


def _unseen_robots(spec: Spec, arrays: Mapping[str, np.ndarray], how: Any) -> np.ndarray:
    _flag(how, "unseen_robots")
    if spec.robots < 3:
        raise InputError(f"splits, unseen_robots, has {spec.robots} robots; allowed: 3 or more")
    return _deal(spec.robots, _shares(spec), generator(spec.seed, "split unseen_robots"))[arrays["robot"]]


def _flag(how: Any, name: str) -> None:
    if how is not True:
        raise InputError(f"splits, {name}, is {how!r}; allowed: true")


_SPLITS = {
    "random": _random,
    "focus_blocks": _focus_blocks,
    "unseen_tilts": _unseen_tilts,
    "unseen_robots": _unseen_robots,
}
