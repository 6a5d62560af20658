"""Recordings of sessions: what the hands did, what the simulation was, what was felt, and all else that a replay needs.

The loop hands over references and goes on; a thread of the `RecordingWriter` writes them into an MCAP file. Nothing
here blocks the loop: what the disk does not take in time is dropped, counted and reported. Beside it
(open file first):

file        the format: messages and force laws, written and read bit for bit
scenery     what it says once, for other programs: the scene as markers, and what its JSON looks like
frames      reads the moments of a recording, for those who look at it
replay      runs the haptic chains of a recording again and compares their forces
"""

from __future__ import annotations

import dataclasses
import json
import queue
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import otwarp
from otwarp.errors import InputError
from otwarp.haptics.core import CYCLE, SceneFrame
from otwarp.haptics.core.config import HapticsConfig
from otwarp.haptics.core.fields import to_dict
from otwarp.haptics.force.law import Law
from otwarp.haptics.recording import COMMANDS, CONFIG, END, PACE, START, part_of
from otwarp.haptics.servo.link import Cycles
from otwarp.scene import Scene
from otwarp.teleop import Command, LiveFrame, PaceNow
from otwarp.teleop.perception import PerceptionTurn
from otwarp.teleop.recording.file import FORMAT, UNITS, RecordingFile, check_new_recording, laws_to_dict

PACE_FIELDS = tuple(field.name for field in dataclasses.fields(PaceNow))
ROOM, FRAMES = 4096, 1024
"""Messages that may wait for the disk, and how many before frames are dropped: a replay cannot do without cycles and
states, frames are for the eye. 1024 are about 2 s of a session with two hands."""
CLOSE_WITHIN = 60.0
"""Seconds that the disk has for what is left at the end."""


@runtime_checkable
class Recordable(Protocol):
    """What a recording asks of a servo, see `otwarp.haptics.servo.process.ServoProcess`."""

    def record(self, on: bool) -> None:
        """Begin a recording, or end it."""
        ...

    def drain(self, hand: int) -> Cycles:
        """The cycles of a hand since the last call."""
        ...


class RecordingWriter:
    """The recording of a session in a file.

    Args:
        path: `.mcap`; must not exist yet.
        config: Of the hands, as their chains were made with it.
        devices: Hand → device as the user named it.
        laws, kinds: What the hands feel, as `otwarp.haptics.chain.chain.make_chain` had it.
        scene: What is simulated.
        settings: More that is worth keeping, for JSON: rates, seed, speed.
        clock: The loop's; `LiveFrame.wall` and the servo's times are of the same.
        servo: Whose cycles are fetched with every frame; None for hands that cannot be replayed, or whose `cycles` the
            caller hands over.

    Raises:
        InputError: A file that is there already or cannot be made, another ending, a law that cannot be stored, or no
            `rosbags`.

    Attributes:
        file: Where it will be.
        begun: Whether it has a frame.
        dropped: Messages that were not written, because the disk was too slow.
        complaint: One line about what is missing in the file, or why it ended; "" if nothing is.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        config: HapticsConfig,
        devices: Mapping[str, str],
        laws: Mapping[int, Sequence[Law]],
        kinds: Sequence[int],
        scene: Scene,
        settings: Mapping[str, Any] | None = None,
        clock: Callable[[], float] = time.perf_counter,
        servo: Recordable | None = None,
    ):
        self.file = check_new_recording(path)
        self.begun, self.dropped, self.complaint = False, 0, ""
        self._began, self._epoch = clock(), time.time_ns()
        about = {
            "format": FORMAT,
            "otwarp": otwarp.__version__,
            "recorded": datetime.now().astimezone().isoformat(timespec="seconds"),
            "units": UNITS,
            "haptics": to_dict(config),
            "devices": dict(devices),
            **laws_to_dict(laws),
            "kinds": list(kinds),
            "settings": dict(settings or {}),
            # seconds of the loop's clock become ns since 1970 by: epoch + (t - began)
            "clock": {"began": self._began, "epoch": self._epoch},
        }
        self._lost = {hand.name: 0 for hand in config.hands}
        self._axis_maps = {hand.name: hand.axis_map for hand in config.hands}
        self._starts: dict[str, Any] = {}
        self._beats: deque[int] = deque(maxlen=4 * FRAMES)
        self._waiting: queue.Queue[tuple[Callable[..., None], tuple[Any, ...]] | None] = queue.Queue(ROOM)
        self._ending = self._ended = self._closed = self._unwanted = False
        self._thread = threading.Thread(target=self._run, args=(scene, about), name="recording", daemon=True)
        self._thread.start()
        self._servo = servo
        if servo is not None:
            servo.record(True)

    def frame(self, live: LiveFrame, scene: SceneFrame | None = None) -> None:
        """A frame, and the state that was published to the servo with it."""
        self.begun = True
        if scene is not None:
            self.scene(scene, live.wall)
        if self._waiting.qsize() < FRAMES:
            self._put(_frame, live, self._stamp(live.wall))
        else:
            self._drop()
        self._fetch()

    def perceived(self, turn: PerceptionTurn, wall: float) -> None:
        """What a camera said in a turn of the loop, at a time of its clock [s]."""
        self._put(RecordingFile.perceived, turn, self._stamp(wall), self._stamp)

    def scene(self, scene: SceneFrame, wall: float) -> None:
        """A state that was published to the servo at a time of the loop's clock [s]; one that is known is ignored."""
        if scene.beat not in self._beats:
            self._beats.append(scene.beat)
            self._put(RecordingFile.scene, scene, self._stamp(wall))

    def cycles(self, hand: str, cycles: Cycles) -> None:
        """What `ServoProcess.drain` gave of a hand.

        Raises:
            InputError: A hand that the configuration lacks.
        """
        if hand not in self._lost:
            raise InputError(f"hand is {hand!r}; allowed: {', '.join(self._lost) or 'none'}")
        records = cycles.records
        now = CYCLE.unpack_from(records, len(records) - CYCLE.size)[1] if records else self._began
        stamp = self._stamp(now)
        for scene in cycles.scenes:
            self.scene(scene, now)
        if cycles.start is not None and self._starts.get(hand) != cycles.start:
            self._starts[hand] = cycles.start
            text = json.dumps({"tick": cycles.start.tick, "chain": json.loads(cycles.start.text or "null")})
            self._put(RecordingFile.text, START + hand, stamp, text)
        if cycles.lost > self._lost[hand]:
            self._lost[hand] = cycles.lost
            self.complaint = f"recording {self.file}: {cycles.lost} cycles of hand {hand} were lost"
        if records:
            self._put(RecordingFile.cycles, hand, stamp, cycles.lost, records)

    def command(self, command: Command, wall: float) -> None:
        """A command that was carried out, at a time of the loop's clock [s]."""
        line = {"time": wall, "command": type(command).__name__, **dataclasses.asdict(command)}
        self._put(RecordingFile.text, COMMANDS, self._stamp(wall), json.dumps(line))

    def end(self) -> bool:
        """Take no more, and finish the file behind the caller's back; whether that is done. May be called again."""
        if self._servo is not None:
            self._servo.record(False)
            self._fetch()
            self._servo = None
        self._ending = True
        if not self._ended:
            try:
                self._waiting.put_nowait(None)
            except queue.Full:  # the disk is slow: said at the next call
                return False
            self._ended = True
        return not self._thread.is_alive()

    def discard(self) -> None:
        """Leave nothing of it, once it is closed."""
        self._unwanted = True

    def close(self) -> None:
        """Write what waits, finish the file and put it in its place; may be called more than once.

        Raises:
            OSError: It could not be written; what there is lies in `FILE.part`.
        """
        if self._closed:
            return
        self._closed = True
        if not self.end() and not self._ended:
            self._ended = True
            self._waiting.put(None)
        self._thread.join(CLOSE_WITHIN)
        if self._thread.is_alive():
            raise OSError(f"recording {self.file}: not finished after {CLOSE_WITHIN:g} s; see {part_of(self.file)}")
        if part_of(self.file).exists() if self._unwanted else not self.file.exists():
            raise OSError(self.complaint)

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _fetch(self) -> None:
        """The cycles of all hands since the last time."""
        if self._servo is not None:
            for n, hand in enumerate(self._lost):
                self.cycles(hand, self._servo.drain(n))

    def _stamp(self, wall: float) -> int:
        """Time of the loop's clock [s] as ns since 1970."""
        return self._epoch + round((wall - self._began) * 1e9)

    def _put(self, write: Callable[..., None], *arguments: Any) -> None:
        try:
            self._waiting.put_nowait((write, arguments))
        except queue.Full:
            self._drop()

    def _drop(self) -> None:
        self.dropped += 1
        self.complaint = f"recording {self.file}: {self.dropped} messages dropped, the disk is too slow"

    def _run(self, scene: Scene, about: dict[str, Any]) -> None:
        """The thread: writes until it is asked to end; after an error it only takes what is handed over."""
        file: RecordingFile | None = None
        try:
            file = RecordingFile(self.file, scene)
            # the digest of a large scene takes 0.1 s
            file.text(CONFIG, self._epoch, json.dumps(about | {"scene": _about(scene)}))
            file.scenery(self._epoch, self._axis_maps)
            while (item := self._waiting.get()) is not None:
                write, arguments = item
                write(file, *arguments)
            if self._unwanted:
                file.discard()
                return
            file.text(END, time.time_ns(), json.dumps({"dropped": self.dropped, "lost": self._lost}))
            file.close()
        except Exception as error:  # a full disk, most likely; the session goes on
            self.complaint = f"recording {self.file}: ended ({error})"
            if file is not None:
                file.abort()
            while not self._ending or not self._waiting.empty():
                self._waiting.get()
            if self._unwanted:
                shutil.rmtree(part_of(self.file), ignore_errors=True)  # `close` says if it is still there


def _frame(file: RecordingFile, live: LiveFrame, stamp: int) -> None:
    """A frame, and how time goes."""
    file.frame(live, stamp)
    pace = {"beat": live.beat, "wall": live.wall, "step": live.frame.step, "simulated": live.frame.time}
    file.text(PACE, stamp, json.dumps(pace | {name: getattr(live.pace, name) for name in PACE_FIELDS}))


def _about(scene: Scene) -> dict[str, Any]:
    """File and content hash of the scene that a recording is of."""
    from otwarp.scene.digest import scene_digest

    return {
        "file": str(scene.file.resolve()) if scene.file else None,
        "digest": scene_digest(scene),
        "bodies": [body.name for body in scene.bodies],
        "traps": [trap.prim for trap in scene.traps],
    }


class Recordings:
    """At most one recording that is written, and those that have ended and are still being finished.

    Attributes:
        current: The one that is written, None between two.
    """

    def __init__(self) -> None:
        self.current: RecordingWriter | None = None
        self._ending: list[RecordingWriter] = []

    @property
    def file(self) -> Path | None:
        """File of the one that is written."""
        return self.current.file if self.current else None

    @property
    def complaint(self) -> str:
        """One line about what is missing in it, or ""."""
        return self.current.complaint if self.current else ""

    def end(self) -> None:
        """No more comes, and one without a frame goes; to wait for the disk would be a stall that disarms the hands."""
        ended, self.current = self.current, None
        if ended is not None:
            if not ended.begun:
                ended.discard()
            ended.end()
            self._ending.append(ended)

    def finished(self) -> list[OSError]:
        """Let go of those that are finished; why some could not be."""
        return self._close([ended for ended in self._ending if ended.end()])

    def close(self) -> None:
        """Finish all, and wait for them.

        Raises:
            OSError: One could not be finished.
        """
        self.end()
        for error in self._close(tuple(self._ending)):
            raise error

    def _close(self, recordings: Sequence[RecordingWriter]) -> list[OSError]:
        errors: list[OSError] = []
        for recording in recordings:
            self._ending.remove(recording)
            try:
                recording.close()
            except OSError as error:
                errors.append(error)
        return errors
