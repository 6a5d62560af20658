"""A recorded run seen by its camera: frames, what a source says of them, and the track of a body."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from otwarp.errors import InputError
from otwarp.record.folder import check_run
from otwarp.scene import Camera, Scene
from otwarp.scene.transforms import conjugate, rotate, rotation_matrix
from otwarp.simulation.packing.bodies import mobilities
from otwarp.vision.fourier import Fourier
from otwarp.vision.frame import framed
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.rendering import Rendering, expose
from otwarp.vision.replay import Replay
from otwarp.vision.tracking.commands import Commands
from otwarp.vision.tracking.consistency import squared_error
from otwarp.vision.tracking.measurement import Measurement, of_estimate
from otwarp.vision.tracking.mobile import MobileBody
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.tracker import Pose, Tracker
from otwarp.vision.view import camera_of, microscope_of, sensor_of, specimen_of


class Source(Protocol):
    """What turns a piece of a frame into a pose."""

    def look(self, image: np.ndarray, guess: np.ndarray | None) -> tuple[Estimate, float] | None:
        """The pose, and the probability that its tilt has the wrong sign; None where there is no body.

        Args:
            image: (height, width) grey levels.
            guess: (5) x, y [µm], depth [µm], tilt, yaw [rad] expected; None: nothing is.
        """
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedBody:
    """One body of a recorded run, n frames; others may be in the picture.

    Attributes:
        scene: The run's.
        body: Name of the body.
        index: Of it in the scene.
        time: (n) [s].
        position, orientation: (n, B, 3) [µm] and (n, B, 4) of the prims of all bodies.
        commands: Positions and powers of the traps.
        exposure: How long the shutter is open from the time of a frame on [s].
        replay: What moves bodies while it is; None: they stand still.
        step: (n) of the run at each frame, for it.
    """

    scene: Scene
    body: str
    index: int
    time: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    commands: Commands
    exposure: float = 0.0
    replay: Replay | None = None
    step: np.ndarray | None = None

    @classmethod
    def load(
        cls,
        folder: str | Path,
        body: str | None = None,
        *,
        world: int = 0,
        every: int = 1,
        frames: int | None = None,
        camera: str | None = None,
        exposure: float | None = None,
        device: str | None = None,
    ) -> RecordedBody:
        """Read a run.

        Args:
            folder: Of the run.
            body: Name of the body; None: the first robot.
            world: Which of the recorded worlds.
            every: Take one frame of so many.
            frames: At most so many; None: all.
            camera: Prim of the scene's camera, or its last part; None: whatever it is called.
            exposure: How long the shutter is open [s]; None: as the camera says.
            device: On which the run goes on while it is.

        Raises:
            InputError: No run, no frames, no such world, body or camera; an exposure longer than the time to the next
                frame.
        """
        file = Path(folder) / "run.nc"
        check_run(file)
        scene = Scene.load(Path(folder) / "run.usda")
        found, shutter = camera_of(scene).prim, camera_of(scene).exposure if exposure is None else exposure
        if camera is not None and camera not in (found, found.rsplit("/", 1)[-1]):
            raise InputError(f"--camera is {camera}; allowed: {found}")
        index = body_index(scene, body)
        with _opened(file) as data:
            pick = _picked(file, data, world, every, frames)
            time = np.asarray(data["time"][:], dtype=float)
            if shutter > (between := float(np.diff(time[pick]).min())) * (1.0 + 1e-6):
                raise InputError(f"--exposure (or the camera's) is {shutter:g} s; allowed: up to {between:.4g} s, the "
                                 "time from frame to frame")  # fmt: skip
            replay = Replay(scene, data, world, device=device) if shutter > 0.0 else None
            step = np.asarray(data["step"][:]).astype(int)[pick] if shutter > 0.0 else None
            position = np.asarray(data["position"][:, world], dtype=float)[pick]
            orientation = np.asarray(data["orientation"][:, world], dtype=float)[pick]
            if scene.traps:
                told = [np.asarray(data[n][:, world], dtype=float) for n in ("trap_position", "trap_power")]
                commands = Commands.of_samples(time, *told)
            else:
                commands = Commands(np.zeros(1), np.zeros((1, 0)))
        return cls(
            scene=scene, body=scene.bodies[index].name, index=index, time=time[pick], position=position,
            orientation=orientation, commands=commands, exposure=shutter, replay=replay, step=step,
        )  # fmt: skip

    def during(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """(e, B, 3) and (e, B, 4) poses of all bodies while the shutter is open."""
        if self.replay is None or self.step is None:
            return self.position[frame, None], self.orientation[frame, None]
        here = self.position[frame], self.orientation[frame]
        return self.replay.during(*here, int(self.step[frame]), self.exposure)

    def __len__(self) -> int:
        return len(self.time)

    def reference(self) -> np.ndarray:
        """(3) centre of diffusion of the body in the frame of its prim [µm]."""
        return np.array(mobilities(self.scene)[self.index].reference)


def body_index(scene: Scene, body: str | None) -> int:
    """Of a body by its name, or of the first robot.

    Raises:
        InputError: There is none.
    """
    names = [b.name for b in scene.bodies]
    if body is None:
        body = next((b.name for b in scene.bodies if b.kind == "robot"), names[0] if names else "")
    if body not in names:
        raise InputError(f"body is {body or 'not named'}; allowed: {', '.join(names[:8]) or 'nothing, there is none'}")
    return names.index(body)


def in_camera(camera: Camera, position: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3) a place from the camera's middle and focal plane along its axes [µm], and (3, 3) an orientation there."""
    back = conjugate(np.array(camera.orientation))
    place = rotate(back, position) - np.array([*camera.center, camera.focus])
    return place, rotation_matrix(back) @ rotation_matrix(orientation)


def check_size(recorded: RecordedBody, size: int) -> None:
    """Refuse pieces of frames that do not hold the body.

    Raises:
        InputError: It is longer in the image than a piece is wide.
    """
    camera = camera_of(recorded.scene)
    alone = dataclasses.replace(recorded.scene, bodies=(recorded.scene.bodies[recorded.index],))
    longest = 0.0
    for place, turn in zip(recorded.position[:, [recorded.index]], recorded.orientation[:, [recorded.index]],
                           strict=True):  # fmt: skip
        solids = specimen_of(alone, place, turn)
        longest = max(longest, float((solids.high - solids.low)[:2].max()))
    least = math.ceil(longest / camera.pixel_size)
    if least > size:
        raise InputError(f"--size (or the network's) is {size} pixels, {size * camera.pixel_size:.3g} µm; allowed: "
                         f"{least} or more, as {recorded.body} is {longest:.3g} µm long")  # fmt: skip


def photograph(
    recorded: RecordedBody,
    poses: tuple[np.ndarray, np.ndarray],
    middle: np.ndarray,
    size: int,
    how: Rendering,
    fourier: Fourier,
    seed: int,
) -> np.ndarray:
    """(size, size) grey levels of a piece of a frame, whatever bodies reach into it.

    Args:
        recorded: The run.
        poses: (e, B, 3) and (e, B, 4) of all bodies while the shutter is open, as of `RecordedBody.during`.
        middle: (2) of the piece, from the middle of the camera's frame [µm].
        size: [pixels].
        how, fourier: Of the rendering.
        seed: Of the sensor's noise.
    """
    scene, total = recorded.scene, np.zeros((size, size))
    microscope, planes = microscope_of(scene), np.array([camera_of(scene).focus])
    for place, turn in zip(*poses, strict=True):
        solids = specimen_of(scene, place, turn).moved([-middle[0], -middle[1], 0])
        there = framed(solids, microscope, size, size, planes, how)
        light = expose(there.specimen, microscope, size, focus=planes, rendering=there.rendering, fourier=fourier)
        total += light.images(planes)[0] / len(poses[0])
    return sensor_of(scene).levels(total, seed=seed)


@dataclass(frozen=True, eq=False, kw_only=True)
class Step:
    """A frame and what was known when it was taken.

    Attributes:
        time: [s].
        image: (size, size) grey levels.
        shown: Place of the body's prim (3) [µm], the mean while the shutter was open, and orientation (4) halfway.
        middle: (2) of the image, from the middle of the camera's frame [µm].
        seen: What the source said of it; None: nothing, or it was dropped.
        pose: By what had come in by then; None before the first measurement.
        nis, degrees, accepted: Of the measurement, as it was put in.
        nees, freedom: Squared error of the pose over its covariance, and its degrees of freedom.
        between: Poses predicted from this frame to the next.
    """

    time: float
    image: np.ndarray
    shown: tuple[np.ndarray, np.ndarray]
    middle: np.ndarray
    seen: Measurement | None
    pose: Pose | None
    nis: float
    degrees: int
    accepted: bool
    nees: float
    freedom: int
    between: tuple[Pose, ...]


def track_run(
    recorded: RecordedBody,
    source: Source,
    *,
    size: int,
    delay: float = 0.0,
    drop: float = 0.0,
    rate: float = 1000.0,
    seed: int = 0,
    rendering: Rendering | None = None,
    device: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[Step]:
    """Follow a body through the frames of a run.

    A piece of every frame is rendered around where the body is expected, on the camera's pixels; the source looks at
    it, and the tracker gets what it says when it would have come.

    Args:
        recorded: The run.
        source: Templates or a network.
        size: Side of the pieces [pixels].
        delay: From light to measurement [s].
        drop: Probability that a frame is lost.
        rate: Of predictions between frames [1/s]; 0: none.
        seed: Of the sensor's noise and of what is lost.
        rendering: How.
        device: Where.
        progress: Told how many frames are done.

    Raises:
        InputError: Numbers out of range, or measurements that cannot be.
    """
    for name, value, high in (("delay", delay, 10.0), ("drop", drop, 0.99), ("rate", rate, 1e5)):
        if not 0.0 <= value <= high:
            raise InputError(f"{name} is {value:g}; allowed: 0 to {high:g}")
    check_size(recorded, size)
    follower = _Follower(recorded, source, size, rendering or Rendering(), Fourier(device), delay)
    lost = np.random.default_rng([seed, 7]).random(len(recorded)) < drop
    lost[0] = False
    steps = []
    for frame in range(len(recorded)):
        steps.append(follower.step(frame, bool(lost[frame]), seed * 1_000_003 + frame, rate))
        if progress is not None:
            progress(frame + 1)
    return [dataclasses.replace(s, **follower.put_in.get(n, {})) for n, s in enumerate(steps)]


class _Follower:
    """A tracker and the measurements on their way to it."""

    def __init__(
        self, recorded: RecordedBody, source: Source, size: int, how: Rendering, fourier: Fourier, delay: float
    ):
        self.recorded, self.source, self.size, self.how = recorded, source, size, how
        self.fourier, self.delay = fourier, delay
        self.camera = camera_of(recorded.scene)
        body = MobileBody(recorded.scene, recorded.body)
        self.shape = Shape.of(recorded.scene, recorded.body, body.reference)
        lag = delay + recorded.exposure + 2.0 * float(np.diff(recorded.time).max())
        self.tracker = Tracker(body, self.shape, recorded.commands, lag=lag)
        self.waiting: list[tuple[float, int, Measurement]] = []
        self.put_in: dict[int, dict[str, float]] = {}

    def step(self, frame: int, lost: bool, seed: int, rate: float) -> Step:
        """Take a frame, look at it, and say where the body is by what has come in."""
        time, open_for = float(self.recorded.time[frame]), self.recorded.exposure
        # what is seen is where the body was halfway, and is known when the shutter has closed
        middle, guess = self._expected(time + 0.5 * open_for)
        poses = self.recorded.during(frame)
        image = photograph(self.recorded, poses, middle, self.size, self.how, self.fourier, seed)
        seen = None if lost else self._looked(image, middle, guess, time + 0.5 * open_for)
        if seen is not None:
            self.waiting.append((time + open_for + self.delay, frame, seen))
        end = float(self.recorded.time[frame + 1]) if frame + 1 < len(self.recorded) else time
        self._arrive(time)
        pose = self.tracker.predict(time) if self.tracker.hypotheses else None
        nees, freedom = math.nan, 0
        if pose is not None:
            nees, freedom = squared_error(pose.belief, self.shape, *self._truth(frame))
        between = tuple(self._between(time, end, rate))
        return Step(
            time=time, image=image, shown=self._shown(poses), middle=middle, seen=seen, pose=pose, nis=math.nan,
            degrees=0, accepted=False, nees=nees, freedom=freedom, between=between,
        )  # fmt: skip

    def _between(self, start: float, end: float, rate: float) -> Iterator[Pose]:
        for n in range(1, math.ceil((end - start) * rate - 1e-6) if rate > 0.0 else 0):
            time = start + n / rate
            self._arrive(time)
            if self.tracker.hypotheses:
                yield self.tracker.predict(time)

    def _arrive(self, time: float) -> None:
        """Put in what has come by now."""
        while self.waiting and self.waiting[0][0] <= time + 1e-12:
            _, frame, seen = self.waiting.pop(0)
            update = self.tracker.add(seen)
            found = {"nis": update.nis, "degrees": update.degrees, "accepted": update.accepted}
            self.put_in[frame] = found

    def _shown(self, poses: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Mean place and middle orientation of the body's prim while the shutter was open."""
        places, turns = (p[:, self.recorded.index] for p in poses)
        return places.mean(axis=0), turns[len(turns) // 2]

    def _truth(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """Centre of diffusion and orientation."""
        turn = self.recorded.orientation[frame, self.recorded.index]
        return self.recorded.position[frame, self.recorded.index] - rotation_matrix(turn) @ self.shape.origin, turn

    def _expected(self, time: float) -> tuple[np.ndarray, np.ndarray | None]:
        """(2) middle of the piece on whole pixels of the camera, and (5) pose within it where one is known."""
        known = bool(self.tracker.hypotheses)
        if known:
            belief = self.tracker.predict(time).belief
            place, turn = belief.position, belief.orientation
        else:
            place, turn = self.tracker.body.start
        seen, frame = in_camera(self.camera, place + rotation_matrix(turn) @ self.shape.arm, turn)
        pixel = self.camera.pixel_size
        middle = np.round(seen[:2] / pixel) * pixel
        axis = frame @ self.shape.axis
        tilt, yaw = math.asin(float(np.clip(axis[2], -1.0, 1.0))), math.atan2(axis[1], axis[0])
        return middle, np.array([*(seen[:2] - middle), seen[2], tilt, yaw]) if known else None

    def _looked(
        self, image: np.ndarray, middle: np.ndarray, guess: np.ndarray | None, time: float
    ) -> Measurement | None:
        found = self.source.look(image, guess)
        if found is None:
            return None
        estimate, mirror = found
        return of_estimate(estimate, time, self.camera, middle, mirror=mirror)


def _opened(file: Path) -> Any:
    """A run's netCDF file, without masks."""
    import netCDF4

    try:
        data = netCDF4.Dataset(file)
    except OSError as error:
        raise InputError(f"{file}: contents = {error.strerror}; allowed: a recorded run's netCDF file") from None
    data.set_auto_mask(False)
    return data


def _picked(file: Path, data: Any, world: int, every: int, frames: int | None) -> np.ndarray:
    """Which frames of a world that is there are taken."""
    worlds, count = len(data.dimensions["world"]), len(data.dimensions["frame"])
    if not 0 <= world < worlds:
        raise InputError(f"{file}: world = {world}; allowed: 0 … {worlds - 1}")
    pick = np.arange(0, count, every)[: frames if frames is not None else count]
    if len(pick) < 2:
        raise InputError(f"{file}: frames = {len(pick)} to track; allowed: 2 or more")
    return pick
