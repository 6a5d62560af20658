"""`FollowedBody`: a body's tracker, where it is now, and whether it counts as seen."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from otwarp.errors import InputError
from otwarp.perception.camera import Piece, Region
from otwarp.perception.estimator import BodyLook, Wanted
from otwarp.scene import Camera, Scene
from otwarp.scene.transforms import rotation_matrix
from otwarp.vision.tracking.belief import Belief, advance, at_prim
from otwarp.vision.tracking.commands import Commands
from otwarp.vision.tracking.mobile import MobileBody
from otwarp.vision.tracking.pushing import PushLaw
from otwarp.vision.tracking.recorded import in_camera
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.tracker import Pose, Tracker
from otwarp.vision.view import solids_of

AHEAD = 0.005
"""Seconds by which a stamp may be ahead of the session's clock."""

PATIENCE = 2.0
"""Of a simulated laboratory: see `LostRule`."""


@dataclass(frozen=True, kw_only=True)
class LostRule:
    """When a body counts as lost.

    Attributes:
        after: Time since the light of the last measurement that its tracker took [s]. What fails, or has the wrong
            time, is not waited for; but after it as long a time has to go by without such an image.
        uncertain: Largest standard deviation of its place, along any direction [µm].
        lag: For how long measurements may be late [s].
        push: Of forces that the twin does not know, on bodies in traps.
        free: The same for bodies that no trap holds.
        patience: Where images come slowly because a laboratory is simulated, `after` is so many times the age that
            light has when the next comes, but never less than said, nor more than `lag`; 0: it is as said.

    Raises:
        InputError: A number out of range.
    """

    after: float = 0.3
    uncertain: float = 1.0
    lag: float = 2.0
    push: PushLaw | None = field(default_factory=PushLaw)
    free: PushLaw | None = field(default_factory=lambda: PushLaw(force=0.1))
    patience: float = 0.0

    def __post_init__(self) -> None:
        limits = {"after": (0.005, 60.0), "uncertain": (1e-3, 1e3), "lag": (0.01, 60.0), "patience": (0.0, 10.0)}
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(f"{name} is {value:g}; allowed: {low:g} to {high:g}")

    def within(self, oldest: float) -> float:
        """Time without a measurement after which a body is lost [s].

        Args:
            oldest: Greatest age of late that light had when the next came [s].
        """
        return min(max(self.after, self.patience * oldest), self.lag) if self.patience else self.after


class FollowedBody:
    """A body that a camera sees.

    Args:
        scene: Of the twin.
        index: Of the body in it.
        camera: Of the scene.
        size: Pixels of its frame (width, height).
        piece: Pixels of the pieces that are looked at (width, height).
        commands: Of all traps, which whoever makes this keeps up to date.
        rule: When it is lost.

    Attributes:
        name: Of the body.
        shape: What is seen of it.
        tracker: Its tracker.
        pose: As predicted last; None before the first measurement.
        why: Why it is lost, one line; "" while it is seen.
        accepted, refused: Measurements so far.
        turns, lost: Turns of the loop so far, and those in which it was lost.
        carried: (3) how far its traps have gone since the start, where it is expected until it is seen [µm].
    """

    def __init__(
        self,
        scene: Scene,
        index: int,
        *,
        camera: Camera,
        size: tuple[int, int],
        piece: tuple[int, int],
        commands: Commands,
        rule: LostRule,
    ):
        self.index, self.name = index, scene.bodies[index].name
        self._camera, self._size, self._piece, self._rule = camera, size, piece, rule
        self._solids = solids_of(scene.bodies[index])
        self._trapped = any(sphere.trapped for sphere in scene.bodies[index].spheres)
        self._body, self._commands = MobileBody(scene, self.name), commands
        self.shape = Shape.of(scene, self.name, self._body.reference)
        self._body.expansion(*self._body.start, commands.values[0])  # compiles what trackers need
        self.restart()

    def restart(self) -> None:
        """Nothing is known but the start of the scene."""
        push = self._rule.push if self._trapped else self._rule.free
        self.tracker = Tracker(self._body, self.shape, self._commands, lag=self._rule.lag, push=push)
        self.pose: Pose | None = None
        self.why = "not seen yet"
        self.accepted = self.refused = self.turns = self.lost = 0
        self.carried = np.zeros(3)
        self._last = -math.inf
        self._said, self._fault, self._faulted = "", "", -math.inf
        self._led: tuple[tuple[Belief, ...], float, Belief] | None = None

    @property
    def seen(self) -> bool:
        """Whether its twin is where the camera has it."""
        return not self.why

    @property
    def rigid(self) -> bool:
        """Whether its orientation is known as well."""
        return self._body.rigid and bool(np.any(self.shape.axis))

    def dated(self, time: float, now: float) -> bool:
        """Whether a stamp can be that of an image which is looked at `now`, on the session's clock [s]."""
        return now - self._rule.lag <= time <= now + AHEAD

    def _misdated(self, late: float) -> str:
        """Why an image that comes `late` s after its stamp is refused."""
        if late > 0.0 and self._rule.patience > 0.0:
            return (
                f"this machine takes {late:.3g} s for an image, allowed up to {self._rule.lag:g} s; "
                "--follow fewer bodies, or --camera-device for images on a GPU"
            )
        if late > 0.0:
            return f"stamps of the camera are {late:.3g} s behind the clock, allowed up to {self._rule.lag:g} s behind"
        return f"stamps of the camera are {-late:.3g} s ahead of the clock, allowed up to {AHEAD:g} s ahead"

    def take(self, one: BodyLook, now: float, *, oldest: float = 0.0) -> None:
        """Put in what a look at it said.

        An image that does not show it is waited out; one that cannot be believed at all is not: until measurements
        were taken for a while without another, it is lost, or a few such images a second had its force come and go.

        Args:
            one: What was seen of it.
            now: Time of the session's clock [s].
            oldest: See `LostRule.within`.
        """
        seen = one.seen
        if seen is None:
            self._said = one.why
            if one.failed:
                self._fault, self._faulted = one.why, now
            return
        if not self.dated(seen.time, now):
            self._refuse(self._misdated(now - seen.time), now)
            return
        try:
            update = self.tracker.add(seen)
        except (InputError, np.linalg.LinAlgError) as error:
            self._refuse(str(error), now)
            return
        if not update.accepted:
            self._said = f"measurements disagree with its motion (χ² = {update.nis:.3g} of {update.degrees})"
            self.refused += 1
            return
        late, after = now - seen.time, self._rule.within(oldest)
        self._last, self._said = max(self._last, seen.time), ""
        self.accepted += 1
        if late > after:
            self._fault = f"an image comes {late:.3g} s after its light, allowed up to {after:.3g} s"
            self._faulted = now
        elif now - self._faulted > after:
            self._fault = ""

    def _refuse(self, why: str, now: float) -> None:
        """A measurement that cannot be one, whatever the body does."""
        self._said = self._fault = why
        self._faulted = now
        self.refused += 1

    def move(self, now: float, *, ended: str = "", oldest: float = 0.0) -> None:
        """Where it is now, and whether that can be believed.

        Args:
            now: Time of the session's clock [s].
            ended: Why its camera gives no more frames, if so.
            oldest: See `LostRule.within`.
        """
        self.why = ended or self._judged(now, self._rule.within(oldest))
        self.turns += 1
        self.lost += bool(self.why)

    def _judged(self, now: float, after: float) -> str:
        beliefs = self.tracker.hypotheses
        oldest = self.tracker.oldest
        if oldest is None or oldest > now:  # or its first stamp is a little ahead of the clock
            return self._said or "not seen yet"
        self.pose = self._predicted(beliefs, now)
        variance = self.pose.covariance[:3, :3]
        if not (np.all(np.isfinite(self.pose.covariance)) and np.all(np.isfinite(self.pose.position))):
            self.restart()
            return "the estimate is not finite"
        if self._fault:
            return self._fault
        worst = math.sqrt(max(float(np.linalg.eigvalsh(variance)[-1]), 0.0))
        if now - self._last > after:
            return f"no measurement for {now - self._last:.2f} s{': ' + self._said if self._said else ''}"
        if worst > self._rule.uncertain:
            return f"uncertain by {worst:.2g} µm, allowed up to {self._rule.uncertain:g} µm"
        return ""

    def _predicted(self, beliefs: tuple[Belief, ...], now: float) -> Pose:
        """The pose now; led on from the last prediction as long as nothing new was measured."""
        led = self._led
        if led is not None and led[0] is beliefs and led[1] <= now:
            belief = advance(led[2], self._body, self._commands, led[1], now)
            probability = self.pose.probability if self.pose is not None else 1.0
            origin, covariance = at_prim(belief, self.shape)
            pose = Pose(time=now, position=origin, orientation=belief.orientation, covariance=covariance,
                        probability=probability, belief=belief)  # fmt: skip
        else:
            pose = self.tracker.predict(now)
        newest = self.tracker.time
        # a measurement that is a little ahead of the clock counts from its time on
        self._led = (beliefs, now, pose.belief) if newest is None or newest <= now else None
        return pose

    def drawn(self, piece: Piece, when: float) -> tuple[np.ndarray | None, np.ndarray | None]:
        """What is believed of it, to be drawn into an image of it.

        Args:
            piece: The image.
            when: Of its light [s].

        Returns:
            (n, 3) column, row and radius of its solids, and the (2, 2) covariance of its place [pixels, pixels²]; None
            twice before it was seen.
        """
        if self.tracker.oldest is None or when < self.tracker.oldest:
            return None, None
        pose = self.tracker.predict(when)
        frame = rotation_matrix(np.array(self._camera.orientation))
        pixel = self._camera.pixel_size
        ends = np.array([place for first, last, _, _ in self._solids for place in (first, last)])
        world = pose.position + ends @ rotation_matrix(pose.orientation).T
        flat = (world @ frame)[:, :2] - np.array(self._camera.center)
        corner = np.array([piece.left - self._size[0] // 2, piece.low - self._size[1] // 2])
        radii = np.repeat([radius for _, _, radius, _ in self._solids], 2) / pixel
        outline = np.column_stack([flat / pixel - corner, radii])
        spread = (frame.T @ pose.covariance[:3, :3] @ frame)[:2, :2] / pixel**2
        return np.unique(outline, axis=0), spread

    def wanted(self) -> Wanted:
        """Where to look for it."""
        # at first the laboratory is taken to be as the scene says; a source that finds nothing there seeks anew
        place, turn = self._body.start
        place = place + self.carried
        if self.pose is not None:
            place, turn = self.pose.belief.position, self.pose.belief.orientation
        at, frame = in_camera(self._camera, place + rotation_matrix(turn) @ self.shape.arm, turn)
        pixel = self._camera.pixel_size
        column, row = (round(float(v) / pixel) + s // 2 for v, s in zip(at[:2], self._size, strict=True))
        # a place beyond the frame is looked for at its edge
        column, row = min(max(column, 0), self._size[0] - 1), min(max(row, 0), self._size[1] - 1)
        wide, high = self._piece
        region = Region(column - wide // 2, row - high // 2, wide, high)
        axis = frame @ self.shape.axis
        tilt, yaw = math.asin(float(np.clip(axis[2], -1.0, 1.0))), math.atan2(axis[1], axis[0])
        x, y = at[0] - (column - self._size[0] // 2) * pixel, at[1] - (row - self._size[1] // 2) * pixel
        return Wanted(self.index, region, np.array([x, y, at[2], tilt, yaw]))
