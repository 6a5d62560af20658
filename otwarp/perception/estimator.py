"""From a camera's frame to a measurement of each body: the piece around it, what a source says of it, and when."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.perception.camera import CameraFrame, Piece, Region
from otwarp.perception.hidden import Outline, look_past
from otwarp.scene import Camera
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.tracking.finding import crop
from otwarp.vision.tracking.measurement import Measurement, of_estimate
from otwarp.vision.tracking.recorded import Source
from otwarp.vision.tracking.source import NetworkSource

DEEPEST = 1e3
"""Height above or below the focal plane that a microscope may see [µm]."""


@dataclass(frozen=True, eq=False)
class Wanted:
    """A body to be looked for.

    Attributes:
        body: Index in the scene.
        region: Of the camera's frame around where it is expected.
        guess: (5) x, y [µm], depth [µm], tilt, yaw [rad] that is expected, from the middle of the region; None: nothing
            is known of it.
    """

    body: int
    region: Region
    guess: np.ndarray | None


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyLook:
    """What a frame says of a body.

    Attributes:
        body: Index in the scene.
        piece: That was looked at.
        guess: As it was expected, from the middle of the piece.
        seen: The measurement; None: it was not seen.
        why: Why it was not, one line.
        failed: Whether that is because what looked at it failed, or said what is no number.
    """

    body: int
    piece: Piece
    guess: np.ndarray | None
    seen: Measurement | None
    why: str = ""
    failed: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Look:
    """What came of a frame.

    Attributes:
        number, time, exposure, made, sent: Of the frame, see `CameraFrame`.
        read: When it was taken out of the camera [s].
        crop, estimate: What cutting pieces and looking at them took, for all bodies together [s].
        done: When that was done [s].
        bodies: Each that was looked for.
    """

    number: int
    time: float
    exposure: float
    made: float
    sent: float
    read: float
    crop: float
    estimate: float
    done: float
    bodies: tuple[BodyLook, ...]


class Estimator:
    """Looks at frames.

    Args:
        camera: Of the scene, whose pixels the frames have.
        size: Pixels of its whole frame (width, height).
        sources: Body's index → what turns its piece into a pose.
        outlines: Body's index → where its solids are, for pieces that others reach into.
    """

    def __init__(
        self,
        camera: Camera,
        size: tuple[int, int],
        sources: Mapping[int, Source],
        outlines: Mapping[int, Outline] | None = None,
    ):
        self._camera, self._size, self._outlines = camera, size, dict(outlines or {})
        self.sources = dict(sources)

    def look(self, frame: CameraFrame, wanted: Sequence[Wanted], read: float) -> Look:
        """Measurements of all bodies that are wanted.

        Args:
            frame: From the camera.
            wanted: Where bodies are expected.
            read: When the frame was taken out of the camera [s].
        """
        begun = time.perf_counter()
        cut = [self._cut(frame, w) for w in wanted]
        middle = time.perf_counter()
        bodies = self._look_at(frame.time, cut)
        end = time.perf_counter()
        return Look(
            number=frame.number, time=frame.time, exposure=frame.exposure, made=frame.made, sent=frame.sent, read=read,
            crop=middle - begun, estimate=end - middle, done=read + end - begun, bodies=bodies,
        )  # fmt: skip

    def warm_up(self) -> None:
        """Show every network an empty image, so that none of the first frames waits for libraries and graphs."""
        for source in self.sources.values():
            if isinstance(source, NetworkSource):
                source.look(np.zeros((source.side, source.side), dtype=np.uint8), None)

    def again(self, look: Look) -> tuple[BodyLook, ...]:
        """The same pieces looked at once more, as a replay does."""
        blank = [
            dataclasses.replace(one, seen=None, failed=False, why="" if one.piece.levels.size else one.why)
            for one in look.bodies
        ]
        return self._look_at(look.time, blank)

    def middle(self, piece: Piece) -> np.ndarray:
        """(2) of a piece, from the middle of the camera's frame [µm]."""
        high, wide = piece.levels.shape
        column, row = piece.left + wide // 2, piece.low + high // 2
        return np.array([column - self._size[0] // 2, row - self._size[1] // 2]) * self._camera.pixel_size

    def _cut(self, frame: CameraFrame, wanted: Wanted) -> BodyLook:
        """The piece of a frame around a body: one that the camera cut for it, or cut here."""
        region = wanted.region
        column, row = region.middle
        near: list[tuple[float, Piece]] = []
        for piece in frame.pieces:
            high, wide = piece.levels.shape
            off = math.hypot(piece.left - region.left, piece.low - region.low)
            if (high, wide) == (region.height, region.width) and off < 0.5 * min(wide, high):
                near.append((off, piece))  # the camera was told where to look before it was asked again
        if near:
            piece = min(near, key=lambda one: one[0])[1]
            # what is expected counts from the middle of the piece, which may be a little aside
            aside = np.array([region.left - piece.left, region.low - piece.low], dtype=float)
            moved = np.array([*(aside * self._camera.pixel_size), 0.0, 0.0, 0.0])
            guess = None if wanted.guess is None else wanted.guess + moved
            return BodyLook(body=wanted.body, piece=piece, guess=guess, seen=None)
        for piece in frame.pieces:
            high, wide = piece.levels.shape
            if piece.left <= column < piece.left + wide and piece.low <= row < piece.low + high:
                levels, _ = crop(piece.levels, column - piece.left, row - piece.low, region.width, region.height)
                found = Piece(region.left, region.low, levels)
                return BodyLook(body=wanted.body, piece=found, guess=wanted.guess, seen=None)
        nothing = Piece(region.left, region.low, np.zeros((0, 0), dtype=np.uint8))
        why = "it is beyond the camera's frame"
        return BodyLook(body=wanted.body, piece=nothing, guess=wanted.guess, seen=None, why=why)

    def _look_at(self, when: float, cut: Sequence[BodyLook]) -> tuple[BodyLook, ...]:
        return tuple(one if one.why else self._looked(when, one, cut) for one in cut)

    def _looked(self, when: float, one: BodyLook, all_of_them: Sequence[BodyLook]) -> BodyLook:
        try:
            seen = self._measured(when, one, all_of_them)
        except (InputError, ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            # whatever an estimator stumbles over, the body is not seen, and the session goes on
            said = " ".join(str(error).split()) or repr(error)
            return dataclasses.replace(one, seen=None, why=f"the estimator fails: {said}", failed=True)
        return dataclasses.replace(one, seen=seen, why="" if seen is not None else "the image does not show it")

    def _measured(self, when: float, one: BodyLook, all_of_them: Sequence[BodyLook]) -> Measurement | None:
        """What its source says of its piece; None: it is not there.

        Raises:
            ValueError: That is no place within the piece.
            Exception: The source fails.
        """
        source, levels = self.sources[one.body], one.piece.levels
        if one.guess is None or one.body not in self._outlines:
            found = source.look(levels, one.guess)
        else:
            found = look_past(source, levels, one.guess, *self._hidden(one, all_of_them))
        if found is None:
            return None
        estimate, mirror = found
        _check_place(estimate, levels, self._camera.pixel_size)
        seen = of_estimate(estimate, when, self._camera, self.middle(one.piece), mirror=mirror)
        # who is less sure than that the body is somewhere in the piece has not found it
        widest = np.array(levels.shape[::-1]) * self._camera.pixel_size
        return seen if np.all(np.diag(seen.covariance)[:2] < widest**2) else None

    def _hidden(self, one: BodyLook, all_of_them: Sequence[BodyLook]) -> tuple[np.ndarray, np.ndarray]:
        """Which pixels of a piece other bodies are expected in, and in which the body itself."""
        assert one.guess is not None
        shape, pixel = (one.piece.levels.shape[0], one.piece.levels.shape[1]), self._camera.pixel_size
        own = self._outlines[one.body].covers(shape, pixel, one.guess)
        hidden, middle = np.zeros(shape, dtype=bool), self.middle(one.piece)
        for other in all_of_them:
            if other.body != one.body and other.guess is not None and other.body in self._outlines:
                pose = other.guess.copy()
                pose[:2] += self.middle(other.piece) - middle
                hidden |= self._outlines[other.body].covers(shape, pixel, pose)
        return hidden, own


def _check_place(estimate: Estimate, levels: np.ndarray, pixel: float) -> None:
    """Refuse a pose that is no number, or lies where the piece cannot show it.

    Raises:
        ValueError: So it is.
    """
    if not np.all(np.isfinite(estimate.mean)):
        raise ValueError("it says nan")
    high, wide = levels.shape
    # what is at an edge may be found a little beyond it
    limits = np.array([wide * pixel, high * pixel, DEEPEST])
    place = np.array([estimate.x, estimate.y, estimate.depth])
    if np.any(np.abs(place) > limits):
        said = ", ".join(f"{v:.3g}" for v in place)
        raise ValueError(
            f"it says {said} µm from the middle of its piece; allowed: up to {limits[0]:.3g}, {limits[1]:.3g}, "
            f"{limits[2]:g}"
        )
