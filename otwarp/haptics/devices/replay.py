"""Plays positions and buttons of a recording, without feeling anything.

MCAP: a recording of `otwarp teleop --record`, of which it plays one side. One that is cut short is played up to there,
and so is the folder `FILE.mcap.part` that a killed session leaves. ROS bag: poses of a topic, such as a Touch's driver
publishes, read by `rosbags`: ROS 1 `.bag`, ROS 2 bags in a folder or as one `.db3`; positions count in metres unless
`unit=mm`, which the driver of the paper's release publishes. CSV: a header that names `time,x,y,z` and, if there are
any, `buttons`; other columns are ignored. JSON lines: one object per line with `time`, `position` (three numbers) and,
if there are any, `buttons`. Times [s] increase, positions in metres. Numbers written by `repr` come back bit for bit.
"""

from __future__ import annotations

import csv
import json
import math
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, DeviceInfo, DeviceLost, DeviceSample, Vec3
from otwarp.haptics.devices import DeviceSpec, parse_parameters
from otwarp.haptics.recording import CONFIG, PART, SUFFIX, McapFile, is_recording

EDGE = 1e-9
"""Seconds by which a sample may be early: differences of clock times round, and a sample must not slip by a cycle."""
FARTHEST = 10.0
"""Metres; no hand is farther from its device."""
COLUMNS = ("time", "x", "y", "z")
UNITS = {"m": 1.0, "mm": 1e-3}
"""Metres."""
POSE = "geometry_msgs/msg/PoseStamped"
SUFFIXES = (".bag", ".db3")
OPTIONS = {"loop": ("0", "1"), "hand": ("left", "right"), "unit": tuple(UNITS), "topic": None}
"""What may come after the file's name, and its values, if it has only a few."""


class ReplayDevice:
    """A recording as a device: holds each sample until the time of the next, from its first `read` on.

    After the last sample the hand stays where it was, lets go of all buttons, and is no longer fresh.

    Args:
        file: The recording, `.mcap`, the folder `.mcap.part`, a bag, `.csv` or `.jsonl`.
        name: As the user named it.
        loop: Whether to start again at the end.
        hand: Which side of a recording of ours; None for the one that it has.
        topic, unit: Of a bag, see `bag_samples`.
    """

    def __init__(
        self,
        file: Path,
        name: str = "replay",
        loop: bool = False,
        hand: str | None = None,
        *,
        topic: str | None = None,
        unit: str = "m",
    ):
        self._file, self._loop, self._hand = file, loop, hand
        self._topic, self._unit = topic, unit
        self.info = DeviceInfo(name=name, kind="replay")
        self._times, self._positions, self._buttons = array("d"), array("d"), array("Q")
        self._start: float | None = None
        self._at = 0
        self._opened = False

    def open(self) -> None:
        """Read the recording.

        Raises:
            InputError: It is not there, or a line is not what it must be.
        """
        own = is_recording(self._file)
        bag = not own and is_bag(self._file)
        word = "pose" if bag else "cycle" if own else "line"
        self._times, self._positions, self._buttons = array("d"), array("d"), array("Q")
        samples = bag_samples(self._file, self._topic, self._unit) if bag else _samples(self._file, self._hand)
        for line, time, position, buttons in samples:
            where = f"{self._file}, {word} {line}"
            if not math.isfinite(time) or (self._times and time <= self._times[-1]):
                raise InputError(f"{where}: time = {time!r} must be a number above the one before")
            if len(position) != 3 or not all(abs(x) <= FARTHEST for x in position):
                raise InputError(f"{where}: position = {position!r} must be three numbers within ±{FARTHEST:g} m")
            if not 0 <= buttons < 2**32:
                raise InputError(f"{where}: buttons = {buttons!r} must be from 0 to 2^32 − 1")
            self._times.append(time)
            self._positions.extend(position)
            self._buttons.append(buttons)
        if not self._times:
            raise InputError(f"{self._file}: holds no sample")
        self._start, self._at, self._opened = None, 0, True

    def read(self, time: float) -> DeviceSample:
        """See `Device`."""
        if not self._opened:
            raise DeviceLost(f"{self.info.name} is not open")
        times = self._times
        if self._start is None:
            self._start = time
        played = time - self._start + times[0]
        if self._loop and played > times[-1] + EDGE:
            self._start, self._at, played = time, 0, times[0]
        at, last = self._at, len(times) - 1
        while at < last and times[at + 1] <= played + EDGE:
            at += 1
        self._at = at
        over = at == last and played > times[last] + EDGE
        x, y, z = self._positions[3 * at : 3 * at + 3]
        return DeviceSample(time, (x, y, z), 0 if over else self._buttons[at], not over)

    def write(self, force: Vec3 = ZERO) -> None:
        """Ignores the force: the motion is that of the recording."""

    def close(self) -> None:
        """See `Device`."""
        self._opened = False


def _samples(file: Path, hand: str | None) -> Iterator[tuple[int, float, Sequence[float], int]]:
    """(line, time, position, buttons) of a recording."""
    readers = {".csv": _csv, ".jsonl": _jsonl}
    if is_recording(file):
        yield from _recorded(file, hand)
        return
    reader = readers.get(file.suffix.lower())
    if reader is None:
        raise InputError(f"{file}: a recording must be one of {', '.join((SUFFIX, PART, *SUFFIXES, *readers))}")
    try:
        with file.open(encoding="utf-8", newline="") as lines:
            yield from reader(file, lines)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cannot be read ({error})") from None


def _recorded(file: Path, hand: str | None) -> Iterator[tuple[int, float, Sequence[float], int]]:
    """One side of a recording; of samples that only repeat the last one, or are no numbers, it has none."""
    from otwarp.haptics.core import FRESH, SAMPLED, cycles_of
    from otwarp.haptics.recording import CYCLES_TYPE, unpack_cycles

    batches: dict[str, list[bytes]] = {}
    with McapFile(file) as recording:
        known = False
        for message in recording.messages():
            known = known or message.topic == CONFIG
            if message.kind == CYCLES_TYPE:
                name, _, records = unpack_cycles(message.data)
                batches.setdefault(name, []).append(records)
    if not known:
        raise InputError(f"{file}: is no recording of otwarp, or too little of one; it has no {CONFIG}")
    if hand is None and len(batches) == 1:
        (hand,) = batches
    if hand not in batches:
        has = f"hand={', hand='.join(sorted(batches))}" if batches else "a recording of a session that had a device"
        raise InputError(f"{file}: holds no hand {hand or 'that was named'!r}; allowed: {has}")
    for records in batches[hand]:
        for cycle in cycles_of(records):
            heard = cycle.flags & SAMPLED and cycle.flags & FRESH
            if heard and math.isfinite(sum(cycle.position)):
                yield cycle.tick, cycle.time, cycle.position, cycle.buttons


def _csv(file: Path, lines: Iterator[str]) -> Iterator[tuple[int, float, Sequence[float], int]]:
    try:
        rows = csv.DictReader(lines, strict=True)
        if missing := [c for c in COLUMNS if c not in (rows.fieldnames or ())]:
            raise InputError(f"{file}, line 1: header lacks {', '.join(missing)}; must name time,x,y,z[,buttons]")
        for row in rows:
            try:
                time, *position = (float(row[c]) for c in COLUMNS)
                buttons = int(row.get("buttons") or 0)
            except (TypeError, ValueError):
                raise InputError(f"{file}, line {rows.line_num}: must hold numbers for time,x,y,z[,buttons]") from None
            yield rows.line_num, time, position, buttons
    except csv.Error as error:
        raise InputError(f"{file}: is not CSV ({error})") from None


def _jsonl(file: Path, lines: Iterator[str]) -> Iterator[tuple[int, float, Sequence[float], int]]:
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            record = json.loads(line)
            time, position = float(record["time"]), [float(x) for x in record["position"]]
            buttons = int(record.get("buttons", 0))
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
            raise InputError(
                f'{file}, line {number}: must be {{"time": s, "position": [x, y, z], "buttons": bits}}'
            ) from None
        yield number, time, position, buttons


def is_bag(file: Path) -> bool:
    """Whether a recording is a bag, by its name or because it is the folder of one."""
    return file.suffix.lower() in SUFFIXES or (file / "metadata.yaml").is_file()


def bag_samples(file: Path, topic: str | None, unit: str) -> Iterator[tuple[int, float, list[float], int]]:
    """(number, time, position, buttons) of the poses in a bag; times [s] count from the first, positions in metres.

    Args:
        file: `.bag`, `.db3`, or the folder of a ROS 2 bag.
        topic: Of type PoseStamped; None for the only one that there is.
        unit: Key of `UNITS`.

    Raises:
        InputError: No bag, no such topic, several to choose from, or no `rosbags`.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
    except ImportError:
        raise InputError(f"{file}: a bag needs the package rosbags; install otwarp[teleop]") from None
    if not file.exists():
        raise InputError(f"{file}: cannot be read (no such file)")
    try:
        with AnyReader([file], default_typestore=_typestore()) as bag:
            poses = [c for c in bag.connections if c.msgtype == POSE]
            names = sorted({c.topic for c in poses})
            chosen = topic or (names[0] if len(names) == 1 else None)
            if chosen not in names:
                allowed = ", ".join(f"topic={name}" for name in names) or f"a bag with a topic of type {POSE}"
                raise InputError(f"{file}: has no poses of {topic or 'a topic that was named'}; allowed: {allowed}")
            first, last = None, -1
            messages = bag.messages([c for c in poses if c.topic == chosen])
            for number, (connection, stamp, data) in enumerate(messages, 1):
                if stamp <= last:  # two messages that came at once: the first counts
                    continue
                first, last = stamp if first is None else first, stamp
                place: Any = bag.deserialize(data, connection.msgtype).pose.position  # type: ignore[attr-defined]
                scale = UNITS[unit]
                yield number, 1e-9 * (stamp - first), [scale * place.x, scale * place.y, scale * place.z], 0
    except InputError:
        raise
    except (AnyReaderError, OSError, ValueError, KeyError, AssertionError) as error:
        raise InputError(f"{file}: cannot be read as a bag ({error})") from None
    except Exception as error:  # a damaged bag fails in whatever its reader is made of
        raise InputError(f"{file}: cannot be read as a bag ({type(error).__name__}: {error})") from None


def _typestore() -> Any:
    """Types for bags that do not bring their own."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def create(spec: DeviceSpec) -> ReplayDevice:
    """`replay:FILE`, and after it `,loop=1`; for ours `,hand=left`, by default that of the same name; for
    a bag `,topic=/NAME` and `,unit=mm`."""
    # a file's name may hold commas and equals signs; only these endings are options
    path, options = spec.argument or "", ["replay"]
    while True:
        rest, comma, option = path.rpartition(",")
        if not comma or option.partition("=")[0].strip() not in OPTIONS:
            break
        path = rest
        options.append(option)
    where = f"device {spec.text!r}"
    _, found = parse_parameters(where, ",".join(options), tuple(OPTIONS))
    for name, value in found.items():
        choices = OPTIONS[name]
        if choices and value not in choices:
            raise InputError(f"{where}: {name} = {value!r} must be {' or '.join(choices)}")
    hand, bag = found.get("hand", spec.name), {"topic": found.get("topic"), "unit": found.get("unit", "m")}
    return ReplayDevice(Path(path), spec.text, found.get("loop") == "1", hand, **bag)
