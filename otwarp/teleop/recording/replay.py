"""A recording, felt again: the same chains, given the recorded samples, states and orders, must send the same forces.

Bit for bit: every force, what was asked of safety, the energy, the state and the motion of the traps are compared as
the bytes of their floats.
"""

from __future__ import annotations

import dataclasses
import json
import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import make_chain
from otwarp.haptics.chain.rendering import Rendering
from otwarp.haptics.core import (
    ABSOLUTE,
    ACTIONS,
    ARMED,
    FAILED,
    FRESH,
    GAINS,
    LOST,
    MADE,
    PRESENT,
    STATES,
    STEPPED,
    ZERO,
    Cycle,
    DeviceInfo,
    DeviceSample,
    SceneFrame,
    ServoFrame,
    Vec3,
    actions_of,
    cycles_of,
    scene_from_list,
)
from otwarp.haptics.core.config import HandConfig, HapticsConfig
from otwarp.haptics.core.fields import from_dict
from otwarp.haptics.force.law import Law
from otwarp.haptics.recording import (
    CONFIG,
    CYCLES,
    CYCLES_TYPE,
    END,
    SCENE,
    SCENE_TYPE,
    START,
    McapFile,
    beat_of,
    unpack_cycles,
    unpack_scene,
    unpack_text,
)
from otwarp.teleop.recording.file import FORMAT, laws_from_dict


@dataclass(frozen=True, slots=True)
class HandReplay:
    """How a hand's forces compare.

    Attributes:
        hand: Its name.
        cycles: Recorded.
        compared: Of which the chain was run again and compared; the device was away, at fault or not begun in others.
        mismatches: Of which anything differed.
        first: The first that differed, one line, or "".
        gaps: How often cycles are missing between two.
        missing: Cycles between the first and the last that are not in the recording.
        skipped: Cycles that could not be run again: after a gap, or without their state, until a chain was made anew.
    """

    hand: str
    cycles: int
    compared: int
    mismatches: int
    first: str
    gaps: int
    missing: int
    skipped: int


@dataclass(frozen=True, slots=True)
class ReplayReport:
    """How the forces of a recording compare with those of its replay.

    Attributes:
        file: The recording.
        complete: Whether it was finished; a killed session's ends where it was killed, a cut one at the cut.
        seconds: Of the session that could be read, from the beginning to the last message [s].
        recorded: By which version of otwarp.
        states: Of the simulation.
        hands: Each hand.
        law: What computed its forces, as the session said; replays use the law in Python, which has the same bits.
    """

    file: str
    complete: bool
    seconds: float
    recorded: str
    states: int
    hands: tuple[HandReplay, ...]
    law: str = ""

    @property
    def equal(self) -> bool:
        """Whether nothing differed, and something was compared."""
        return not any(hand.mismatches for hand in self.hands) and any(hand.compared for hand in self.hands)

    @property
    def verdict(self) -> str:
        """What came of it and why, one line."""
        compared = sum(hand.compared for hand in self.hands)
        if different := sum(hand.mismatches for hand in self.hands):
            return f"not equal: {different} cycles differ"
        if compared:
            return f"equal: all forces of {compared} cycles, bit for bit"
        if not self.hands:
            why = "no hand had a device"
        elif not any(hand.cycles for hand in self.hands):
            why = "it has no cycles of any hand"
        else:
            why = "no cycle could be run again"
        return f"nothing to compare: {why}"

    def to_dict(self) -> dict[str, Any]:
        """The report as numbers and texts for a JSON file, with `equal` and `verdict`."""
        return dataclasses.asdict(self) | {"equal": self.equal, "verdict": self.verdict}


def replay_recording(path: str | Path) -> ReplayReport:
    """Run the chains of a recording again and compare.

    Args:
        path: The recording, one that is cut short, or the folder `FILE.mcap.part` that a killed session left.

    Raises:
        InputError: It cannot be read, is no recording, or one of a newer otwarp.
    """
    with McapFile(path) as file:
        try:
            recording = _Recording(file)
            hands = tuple(recording.replay(hand) for hand in recording.config.hands)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: cannot be replayed; it is damaged ({error!r})") from None
        return ReplayReport(
            str(path),
            recording.complete,
            recording.seconds,
            recording.version,
            len(recording.states),
            hands,
            recording.law,
        )


class _Recording:
    """What a replay needs of a recording."""

    def __init__(self, file: McapFile) -> None:
        where = file.path
        about: Any = None
        self.states: dict[int, memoryview] = {}
        self.batches: dict[str, list[memoryview]] = {}
        self.starts: dict[str, Mapping[str, Any]] = {}
        self.complete, first, last = False, math.inf, -math.inf
        for message in file.messages():
            if message.topic != END:  # written when the disk was done
                first, last = min(first, message.time), max(last, message.time)
            if message.topic == CONFIG:
                about = _json(where, CONFIG, message.data)
            elif message.topic == SCENE and message.kind == SCENE_TYPE:
                beat = beat_of(message.data)
                if self.states.setdefault(beat, message.data) != message.data:
                    raise InputError(f"{where}: has two states of beat {beat}; allowed: one")
            elif message.topic.startswith(CYCLES) and message.kind == CYCLES_TYPE:
                self.batches.setdefault(message.topic[len(CYCLES) :], []).append(message.data)
            elif message.topic.startswith(START):
                self.starts.setdefault(message.topic[len(START) :], _json(where, message.topic, message.data))
            elif message.topic == END:
                self.complete = True
        self.complete = self.complete and file.complete
        if not isinstance(about, dict):
            raise InputError(f"{where}: is no recording of otwarp, or too little of one; it has no {CONFIG}")
        if about.get("format") != FORMAT:
            raise InputError(f"{where}: is a recording of format {about.get('format')!r}; allowed: {FORMAT}")
        self.where, self.version = where, str(about.get("otwarp"))
        self.seconds = 1e-9 * (last - first)  # there was a message: the configuration
        self.config: HapticsConfig = from_dict(HapticsConfig, about.get("haptics"), f"{where}: haptics")
        self.laws: dict[int, tuple[Law, ...]] = laws_from_dict(about)
        self.kinds: Sequence[int] = tuple(about.get("kinds", ()))
        self.law = str(about.get("settings", {}).get("law") or "")

    def replay(self, config: HandConfig) -> HandReplay:
        """Run the chain of one hand again, from its recorded start, and compare each cycle with the recorded one."""
        start = self.starts.get(config.name)
        hand = _Hand(self, config, start)
        for data in self.batches.get(config.name, ()):
            _, _, records = unpack_cycles(data)
            for cycle in cycles_of(records):
                hand.cycle(cycle)
        return hand.report()

    def state(self, beat: int) -> SceneFrame | None:
        """The state of a beat, None if the recording lacks it."""
        data = self.states.get(beat)
        return None if data is None else unpack_scene(data)


class _Hand:
    """One hand that lives through its cycles again."""

    def __init__(self, recording: _Recording, config: HandConfig, start: Mapping[str, Any] | None) -> None:
        self._recording, self._name = recording, config.name
        self._rendering = Rendering(partial(make_chain, config, recording.laws, recording.kinds))
        self._known = False
        self._tick: int | None = None
        self._scene: SceneFrame | None = None
        self._cycles = self._compared = self._mismatches = self._gaps = self._missing = self._skipped = 0
        self._first = ""
        if start is not None and start.get("chain") is not None:
            self._rendering.restore(start["chain"])
            self._tick, self._known = int(start["tick"]) - 1, True
            chain = start["chain"].get("chain")
            if chain is not None:
                self._scene = scene_from_list(chain["scene"])

    def cycle(self, cycle: Cycle) -> None:
        """Run one recorded cycle again and compare; cycles that are missing before it are counted."""
        self._cycles += 1
        if self._tick is not None and cycle.tick != self._tick + 1:
            self._gaps += 1
            self._missing += max(0, cycle.tick - self._tick - 1)
            self._forget()
        self._tick = cycle.tick
        self._act(cycle)
        if not cycle.flags & STEPPED:
            if not cycle.flags & PRESENT:
                self._rendering.drop()
                self._known = True  # whatever comes next is made anew
            self._note(cycle, [] if cycle.force == ZERO or not cycle.flags & PRESENT else ["force"], ran=False)
            return
        if not self._known:
            self._skipped += 1
            return
        scene = self._state(cycle.beat)
        if scene is None:
            self._forget()
            self._skipped += 1
            return
        sample = DeviceSample(cycle.sample_time, cycle.position, cycle.buttons, bool(cycle.flags & FRESH))
        now = self._rendering.step(sample, scene)
        self._note(cycle, self._differences(cycle, now), ran=True)
        if cycle.flags & LOST:
            self._rendering.drop()

    def report(self) -> HandReplay:
        """What came of it."""
        counts = (self._cycles, self._compared, self._mismatches, self._first, self._gaps, self._missing, self._skipped)
        return HandReplay(self._name, *counts)

    def _act(self, cycle: Cycle) -> None:
        """What happened to the chain before its step."""
        rendering = self._rendering
        for action in actions_of(cycle.actions):
            if action not in ACTIONS:
                raise InputError(
                    f"{self._recording.where}: cycle {cycle.tick} has the action {action}; allowed: {ACTIONS}"
                )
            if action == MADE:
                rendering.make(self._device(cycle))
                self._known = True
            elif action == GAINS:
                gains = (None if gain != gain else gain for gain in (cycle.motion_gain, cycle.force_gain))
                rendering.set_gains(*gains)
            elif not self._known:
                continue
            elif action == ARMED:
                rendering.arm()
            else:
                rendering.disarm(action)

    def _device(self, cycle: Cycle) -> DeviceInfo:
        """The device as far as a chain knows it."""
        return DeviceInfo(
            name=self._name,
            kind="replay",
            absolute=bool(cycle.flags & ABSOLUTE),
            force=cycle.limit,
            continuous_force=cycle.continuous,
        )

    def _state(self, beat: int) -> SceneFrame | None:
        """The state of a beat; consecutive cycles share one."""
        if self._scene is None or self._scene.beat != beat:
            self._scene = self._recording.state(beat)
        return self._scene

    def _forget(self) -> None:
        """What the chain remembered is not known any more."""
        self._rendering.drop()
        self._known = False

    def _differences(self, cycle: Cycle, now: ServoFrame | None) -> list[str]:
        """Names of what is not the same."""
        if now is None or cycle.flags & FAILED:
            return [] if now is None and cycle.flags & FAILED else ["failure"]
        if cycle.flags & LOST:  # the device took nothing of it
            return []
        chain = self._rendering.chain
        asked, moved = (chain.asked, chain.moved) if chain is not None else (ZERO, ZERO)
        pairs = {
            "force": (cycle.force, now.force),
            "asked": (cycle.asked, asked),
            "energy": ((cycle.energy,), (now.energy,)),
            "moved": (cycle.moved, moved),
        }
        different = [name for name, (was, again) in pairs.items() if _bits(was) != _bits(again)]
        return different + ["state"] * (STATES[cycle.state] != now.state if cycle.state < len(STATES) else 1)

    def _note(self, cycle: Cycle, different: list[str], *, ran: bool) -> None:
        self._compared += ran
        if different:
            self._mismatches += 1
            again = self._rendering.chain.asked if self._rendering.chain is not None else ZERO
            self._first = self._first or (
                f"hand {self._name}, cycle {cycle.tick} at {cycle.time:.6f} s: {', '.join(different)}; "
                f"recorded force {_digits(cycle.force)} N, asked {_digits(cycle.asked)}, again {_digits(again)}"
            )


def _bits(values: Sequence[float]) -> bytes:
    """Floats as their bytes; every nan is the same one."""
    return struct.pack(f"<{len(values)}d", *(math.nan if v != v else v for v in values))


def _digits(v: Vec3) -> str:
    return "({:.9g}, {:.9g}, {:.9g})".format(*v)


def _json(where: Path, topic: str, data: memoryview) -> Any:
    """What a JSON message says."""
    try:
        return json.loads(unpack_text(data))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: {topic} is not JSON ({error})") from None
