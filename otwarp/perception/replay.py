"""A closed loop, seen again: the recorded images must give the same estimates, and these the same states.

Estimates come of the images through networks or templates made anew; trackers take them at the recorded turns; a twin
is aligned, and its spheres are what the servo was given. Measurements, poses and spheres are compared bit for bit; the
forces that follow from these states are compared by `otwarp.teleop.recording.replay`.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.haptics.core.realtime import VirtualClock
from otwarp.haptics.recording import (
    CAMERA,
    CONFIG,
    PERCEPTION,
    SCENE,
    McapFile,
    unpack_image,
    unpack_scene,
    unpack_text,
)
from otwarp.perception.assemble import SeeingOptions, closed_loop, estimator_of, see
from otwarp.perception.camera import CameraInfo, CameraLost
from otwarp.perception.estimator import Look, Wanted
from otwarp.perception.followed import LostRule
from otwarp.perception.recorded import look_from_dict, look_to_dict, same
from otwarp.scene import Camera, Scene
from otwarp.scene.digest import scene_digest
from otwarp.simulation.frame import capture_frame
from otwarp.simulation.simulation import Simulation
from otwarp.teleop.operators import LocalScene
from otwarp.teleop.recording.scenery import frame_of
from otwarp.vision.rendering import Rendering
from otwarp.vision.tracking.pushing import PushLaw


@dataclass(frozen=True, kw_only=True)
class PerceptionReplay:
    """How a recorded closed loop compares with its replay.

    Attributes:
        turns: Of the loop.
        estimates: Pieces that were looked at again; `different` of them gave something else.
        different: See there.
        states: Turns whose poses and spheres were compared; `astray` of them differ.
        astray: See there.
        first: The first that differed, one line, or "".
        note: What could not be compared, and why, or "".
    """

    turns: int
    estimates: int
    different: int
    states: int
    astray: int
    first: str
    note: str

    @property
    def equal(self) -> bool:
        """Whether nothing differed, and something was compared."""
        return self.estimates > 0 and not self.different and not self.astray

    @property
    def verdict(self) -> str:
        """What came of it, one line."""
        if not self.estimates:
            return "images: none to compare"
        found = f"images: {self.estimates} pieces looked at again, {self.different} estimates differ; "
        found += f"{self.states} states, {self.astray} differ"
        return "\n        ".join(line for line in (found, self.first and f"first: {self.first}", self.note) if line)


class _Played:
    """A `Looker` that gives out what it is told to; nothing can be asked of a recording."""

    info = CameraInfo(name="recording", kind="recording")

    def __init__(self) -> None:
        self.due: list[Look] = []
        self.ended = ""

    def start(self, now: float) -> None:
        """See `Looker`: there is no camera to open."""

    def command(self, now: float, position: np.ndarray, power: np.ndarray) -> None:
        """See `Looker`: the images are there already, whatever traps do."""

    def want(self, wanted: Sequence[Wanted]) -> None:
        """See `Looker`: the pieces are those that were cut out."""

    def looks(self, now: float) -> list[Look]:
        """See `Looker`."""
        if self.ended:
            raise CameraLost(self.ended)
        due, self.due = self.due, []
        return due

    def await_look(self, until: float) -> bool:
        """See `Looker`: a replay waits for nothing."""
        return False

    def restart(self) -> None:
        """See `Looker`: no laboratory is simulated."""

    def close(self) -> None:
        """See `Looker`: who replays the recording closes it."""


def replay_perception(path: str | Path) -> PerceptionReplay | None:
    """Look at the images of a recording again; None for a session without a camera.

    Args:
        path: The recording, or the folder `FILE.mcap.part` that a killed session left.

    Raises:
        InputError: It cannot be read, or its scene or networks are not there, or have changed.
    """
    with McapFile(path) as file:
        about = next((json.loads(unpack_text(m.data)) for m in file.messages((CONFIG,))), None)
        if not isinstance(about, dict):
            raise InputError(f"{path}: is no recording of otwarp, or too little of one; it has no {CONFIG}")
        told = about.get("settings", {}).get("perception")
        if told is None:
            return None
        try:
            scene = _scene(about, told, path)
            return _Replay(scene, told, list(about.get("kinds", ())), about["haptics"]).run(file)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: its images cannot be replayed; it is damaged ({error!r})") from None


def _scene(about: Mapping[str, Any], told: Mapping[str, Any], path: str | Path) -> Scene:
    """The scene of the twin, with its camera as it was calibrated."""
    file = about["scene"]["file"]
    if file is None or not Path(file).is_file():
        raise InputError(f"{path}: its scene, {file}, is not there; allowed: the file that was simulated")
    optics: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in told["optics"].items()}
    scene = dataclasses.replace(Scene.load(file), camera=Camera(**optics))
    if scene_digest(scene) != about["scene"]["digest"]:
        raise InputError(f"{path}: its scene, {file}, has changed since; allowed: the one that was simulated")
    return scene


class _Replay:
    """One recording that is seen again."""

    def __init__(self, scene: Scene, told: Mapping[str, Any], kinds: list[int], haptics: Mapping[str, Any]):
        rule = dict(told["rule"])
        push: dict[str, Any] = {
            name: None if rule.get(name) is None else PushLaw(**rule[name]) for name in ("push", "free")
        }
        options = SeeingOptions(
            networks=told["networks"], follow=tuple(told["pieces"]), rendering=Rendering(**told["rendering"]),
            rule=LostRule(**(rule | push)), device=self._device(told.get("device")),
            threads=told.get("threads", 1), any_robot=told.get("any_robot", False),
        )  # fmt: skip
        seeing = see(scene, options)
        self._estimator, self._scene = estimator_of(scene, seeing), scene
        self._names = {n: body.name for n, body in enumerate(scene.bodies)}
        self._looker = _Played()
        self._whole = told["turns"] == 0
        self._clock = VirtualClock(told["began"])
        self._loop = closed_loop(scene, seeing.pieces, self._looker, seeing=options, clock=self._clock)
        self._twin = Simulation(scene, device="cpu", readout=True)
        moved = [trap for hand in haptics["hands"] for trap in hand["traps"]]
        self._local = LocalScene.of(self._twin.model, moved)
        # of more spheres than there are slots, which are given follows from all that was before
        self._spheres = self._local.kinds == tuple(kinds) and bool(kinds)
        self._restarts = 0
        self._counts = dict.fromkeys(("turns", "estimates", "different", "states", "astray"), 0)
        self._first = ""

    def run(self, file: McapFile) -> PerceptionReplay:
        """All turns."""
        for turn, images, state in _turns(file):
            self._counts["turns"] += 1
            looks = [
                look_from_dict(one, [images[frame_of(self._names[b["body"]])].pop(0) for b in one["bodies"]])
                for one in turn["looks"]
            ]
            again = [self._look(one, look) for one, look in zip(turn["looks"], looks, strict=True)]
            if self._whole:
                self._align(turn, again, state)
        notes = [] if self._whole else ["trackers had begun before the recording did: states were not compared"]
        notes += [self._elsewhere] if self._elsewhere else []
        return PerceptionReplay(**self._counts, first=self._first, note="; ".join(notes))

    def _device(self, recorded: str | None) -> str | None:
        """The device on which images were looked at, where it is here: another gives other last bits."""
        self._elsewhere = ""
        try:
            pick_device(recorded)
        except InputError:
            self._elsewhere = f"images were looked at on {recorded}, which is not here: last digits may differ"
            return None
        return recorded

    def _look(self, told: Mapping[str, Any], look: Look) -> Look:
        """A look that is made again, compared with what was recorded."""
        bodies = self._estimator.again(look)
        found = dataclasses.replace(look, bodies=bodies)
        for was, now in zip(told["bodies"], look_to_dict(found)["bodies"], strict=True):
            self._counts["estimates"] += 1
            if not same(was["seen"], now["seen"]) or was["why"] != now["why"]:
                self._counts["different"] += 1
                self._say(f"exposure {look.number}, {self._names[was['body']]}: the estimate")
        return found

    def _align(self, turn: Mapping[str, Any], looks: list[Look], state: Any) -> None:
        """The turn of the loop with these looks, and its state."""
        if turn["restarts"] != self._restarts:
            self._restarts = turn["restarts"]
            self._loop.restart()
        self._looker.due, self._looker.ended = looks, turn["ended"]
        self._clock.sleep_until(turn["now"])
        self._loop.update(self._twin, turn["now"], np.array(turn["trap_position"]), np.array(turn["trap_power"]))
        self._counts["states"] += 1
        again = self._loop.turn(turn["beat"]).told["bodies"]
        wrong = "" if same(turn["bodies"], again) else "the poses"
        # where estimates clashed with what is not seen, the state was the simulation's
        if not wrong and state is not None and self._spheres and turn["aligned"]:
            frame = capture_frame(self._twin)
            seen = {b.index for b in self._loop.bodies if b.seen}
            spheres = self._local.now(state.beat, frame).spheres
            pairs = zip(state.spheres, spheres, strict=True)
            wrong = "a sphere" if any(a != b for a, b in pairs if a.body in seen) else ""
        if wrong:
            self._counts["astray"] += 1
            self._say(f"turn {turn['turn']}, at {turn['now']:.6f} s: {wrong}")

    def _say(self, line: str) -> None:
        self._first = self._first or line


def _turns(file: McapFile) -> Iterator[tuple[dict[str, Any], dict[str, list[np.ndarray]], Any]]:
    """Turns with the images that came before them, by body, and the state that was published in them."""
    images: dict[str, list[np.ndarray]] = {}
    state = None
    for message in file.messages():
        if message.topic.startswith(CAMERA):
            rows, wide, high = unpack_image(message.data)
            kind = np.dtype("u1" if len(rows) == wide * high else "<u2")
            levels = np.frombuffer(rows, dtype=kind).reshape(high, wide)[::-1]
            images.setdefault(message.topic[len(CAMERA) :], []).append(np.ascontiguousarray(levels))
        elif message.topic == SCENE:
            state = unpack_scene(message.data)
        elif message.topic == PERCEPTION:
            turn = json.loads(unpack_text(message.data))
            yield turn, dict(images), state if state is not None and state.beat == turn["beat"] else None
            images.clear()
