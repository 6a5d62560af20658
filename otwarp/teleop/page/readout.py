"""What the page says of a session: texts (HTML, all escaped), and plots of the last seconds.

Texts are task and warnings, the state of each hand, the figures of the loop.
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from otwarp.teleop import HandFrame, PaceNow
from otwarp.teleop.page.protocol import Drawing, PageFrame

if TYPE_CHECKING:
    import viser

QUIET = 6.0
"""Seconds after which the same warning, whatever its numbers, is notified again if it had gone meanwhile."""
MOST_SHOWN = 6
LONGEST_DEVICE = 30
"""Characters of a device's name that fit on its row; the pointer shows the whole of a longer one."""
KEEPS_UP = 0.95
"""Share of the wanted pace below which the figures turn amber."""
_RED, _AMBER, _GREEN, _GREY = "#ff405c", "#ffc24a", "#4ade80", "#8ea2b8"
STATE_COLOURS = {"armed": _GREEN, "ramping": _AMBER, "decaying": _AMBER, "fault": _RED, "disarmed": _GREY}
SPAN, BIN = 20.0, 1.0 / 15.0
"""Seconds that a plot shows, and that one of its points stands for."""
PUSH = 0.2
"""Seconds between two pushes of a plot to the browsers."""
MOST_CURVES = 8
"""Traps or bodies that get a curve each; above that the largest of them makes one."""
HAND_COLOURS = {"left": "#ff7a5c", "right": "#45d0ff"}
CURVES = ("#ff7a5c", "#ffb35c", "#ffe27a", "#45d0ff", "#5c9dff", "#b18cff", "#6ee7a8", "#f28cc8")


def banner(warnings: Sequence[str], pace: PaceNow, recording: str | None, task: str = "") -> str:
    """How the session goes, how the task stands, and a red box with the warnings if there are any."""
    state = _dot(_GREY, "paused") if pace.paused else _dot(_slow(pace), f"running at {pace.factor:.2f} ×")
    if recording is not None:
        state += " &nbsp; " + _dot(_RED, f"recording {_escape(_last(recording))}")
    head = f'<div style="padding:2px 12px 6px;font-size:13px">{state}</div>'
    if task:
        head += f'<div style="padding:0 12px 6px;font-size:13px">{_escape(task)}</div>'
    if not warnings:
        return head
    lines = "".join(f"<div>⚠ {_escape(line)}</div>" for line in warnings[:MOST_SHOWN])
    if len(warnings) > MOST_SHOWN:
        lines += f"<div>and {len(warnings) - MOST_SHOWN} more</div>"
    return (
        head + f'<div style="margin:0 10px 8px;padding:8px 10px;border-radius:6px;background:{_RED};color:#fff;'
        f'font-weight:600;font-size:13px;line-height:1.45;overflow-wrap:anywhere">{lines}</div>'
    )


def hand_text(hand: HandFrame) -> str:
    """One hand: device, state, force, gains, what went wrong."""
    state = hand.now.state if hand.now is not None else "no word yet"
    colour = STATE_COLOURS.get(state, _GREY)
    force = sum(f * f for f in hand.force) ** 0.5
    rows = [
        (
            "device",
            _short(hand.device, LONGEST_DEVICE) + ("" if hand.present else f' <b style="color:{_RED}">absent</b>'),
        ),
        ("state", f'<b style="color:{colour}">{_escape(state)}</b>'),
        ("force", f"{force:.2f} N of {hand.clamp:.2f} N"),
        ("motion gain", f"{hand.motion_gain:.4g} µm/m"),
        ("force gain", f"{hand.force_gain:.4g} N/pN"),
    ]
    if hand.message:
        rows.append(("said", _escape(hand.message)))
    return table(rows)


def figures(frame: PageFrame, rate: float, delay: float | None, visitors: int) -> str:
    """How the loop, the servo and the page keep up.

    Args:
        frame: The newest.
        rate: Frames per second that the page shows.
        delay: From the publication of a frame to an answer of the browser that has it [s], None for unknown.
        visitors: Browser windows.
    """
    pace = frame.pace
    slow = _slow(pace)
    rows = [
        ("simulated", f"{frame.time:.2f} s"),
        ("real-time factor", f'<span style="color:{slow}">{pace.factor:.2f}</span> of {pace.speed:.2f}'),
        ("time slipped", f"{pace.slipped:.2f} s"),
        ("loop", f"{pace.rate:.0f} /s, {100.0 * pace.busy:.0f} % busy"),
        ("page", f"{rate:.0f} frames/s, {visitors} window{'' if visitors == 1 else 's'}"),
        ("state to page", "–" if delay is None else f"≤ {1e3 * delay:.0f} ms"),
    ]
    if frame.servo is not None:
        servo = frame.servo
        rows.append(("servo", f"{_escape(servo.state)}, {servo.late} late cycles"))
        rows.append(("servo lateness", f"{1e6 * servo.lateness:.0f} µs worst of 1 s"))
        if servo.refused:
            rows.append(("states refused", str(servo.refused)))
    if frame.engine:
        rows.append(("force law", _escape(frame.engine)))
    return table(rows)


def table(rows: Sequence[tuple[str, str]]) -> str:
    """Rows of name and value; values are HTML already."""
    body = "".join(
        f'<tr><td style="opacity:0.75;padding:1px 12px 1px 0;white-space:nowrap">{_escape(name)}</td>'
        f'<td style="font-variant-numeric:tabular-nums;overflow-wrap:anywhere">{value}</td></tr>'
        for name, value in rows
    )
    return f'<div style="padding:2px 12px 6px"><table style="font-size:12.5px;line-height:1.4">{body}</table></div>'


class News:
    """Which warnings are new: a warning whose numbers change every frame is one warning."""

    def __init__(self) -> None:
        self._seen: dict[str, float] = {}

    def of(self, warnings: Sequence[str], now: float) -> list[str]:
        """Those that were not there within the last `QUIET` seconds; `now` on any clock [s]."""
        new = []
        for line in warnings:
            key = re.sub(r"[-+]?\d[\d.,e+-]*", "#", line)
            if now - self._seen.get(key, float("-inf")) > QUIET:
                new.append(line)
            self._seen[key] = now
        return new


def _slow(pace: PaceNow) -> str:
    """Colour of a pace: amber where the machine cannot keep up."""
    return _AMBER if pace.factor < KEEPS_UP * pace.speed and not pace.paused else _GREEN


def _dot(colour: str, text: str) -> str:
    return f'<span style="color:{colour}">●</span> {text}'


def _short(text: str, most: int) -> str:
    """Its beginning and its end where it is too long: a device begins with its kind, a file ends with its name."""
    if len(text) <= most:
        return _escape(text)
    end = (most - 1) // 2
    return f'<span title="{_escape(text)}">{_escape(text[: most - 1 - end])}…{_escape(text[-end:])}</span>'


def _last(path: str) -> str:
    return re.split(r"[/\\]", path)[-1]


def _escape(text: object) -> str:
    return html.escape(str(text))


class History:
    """The largest value of each column in each of the last bins.

    Args:
        columns: Number of curves.
        span, bin: Seconds remembered, and per point.
    """

    def __init__(self, columns: int, span: float = SPAN, bin: float = BIN):
        self._bin, self._many = bin, max(2, round(span / bin))
        self._values = np.full((self._many, columns), np.nan)
        self._latest: int | None = None

    def add(self, time: float, values: Sequence[float]) -> None:
        """Note values at a time [s]; a bin without any stays nan, and so does one that is not finite."""
        slot = math.floor(time / self._bin)
        if self._latest is None or slot < self._latest or slot - self._latest >= self._many:
            self._values[:] = np.nan
        else:
            for gone in range(self._latest + 1, slot + 1):
                self._values[gone % self._many] = np.nan
        self._latest = slot
        row, new = self._values[slot % self._many], np.asarray(values, dtype=float)
        self._values[slot % self._many] = np.fmax(row, np.where(np.isfinite(new), new, np.nan))

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) seconds before the latest bin, rising to 0, and (columns, n) values."""
        last = self._many - 1 if self._latest is None else self._latest % self._many
        return (np.arange(self._many) - (self._many - 1)) * self._bin, np.roll(self._values, -last - 1, axis=0).T


@dataclass(frozen=True)
class Panel:
    """A plot: title, curves (label, colour), lines (label, height, colour), and what a frame adds to the curves."""

    title: str
    curves: tuple[tuple[str, str], ...]
    lines: tuple[tuple[str, float, str], ...]
    read: Callable[[PageFrame], Sequence[float]]


def panels(drawing: Drawing, hands: Sequence[str]) -> list[Panel]:
    """The plots of a scene with devices on these hands."""
    chosen = [_force(hands) if hands or drawing.traps else None, _contact(drawing), _distance(drawing)]
    if hands:
        curves = tuple((f"{hand} [mJ]", HAND_COLOURS[hand]) for hand in hands)
        chosen.append(Panel("Passivity energy [mJ]", curves, (), lambda f: _energy(f, hands)))
    return [panel for panel in chosen if panel is not None]


def _force(hands: Sequence[str]) -> Panel:
    if hands:
        curves = tuple((f"{hand} [N]", HAND_COLOURS[hand]) for hand in hands)
        return Panel("Force on the hand [N]", curves, (), lambda f: _hand_forces(f, hands))
    curves = tuple((f"{hand} [pN]", HAND_COLOURS[hand]) for hand in ("left", "right"))
    return Panel("Force of each hand's traps [pN]", curves, (), lambda f: np.linalg.norm(f.hand_force, axis=1).tolist())


def _hand_forces(frame: PageFrame, hands: Sequence[str]) -> list[float]:
    force = {hand.name: math.hypot(*hand.force) for hand in frame.hands}
    return [force.get(hand, math.nan) for hand in hands]


def _energy(frame: PageFrame, hands: Sequence[str]) -> list[float]:
    energy = {hand.name: 1e3 * hand.now.energy for hand in frame.hands if hand.now is not None}
    return [energy.get(hand, math.nan) for hand in hands]


def _contact(drawing: Drawing) -> Panel | None:
    if not drawing.names:
        return None
    many = len(drawing.names)
    lowest = float(np.min(drawing.warning_force))
    lines = ((f"warning {lowest:g} pN", lowest, _RED),) if math.isfinite(lowest) else ()
    if many <= MOST_CURVES:
        curves = tuple(zip(drawing.names, CURVES, strict=False))
        return Panel("Contact load [pN]", curves, lines, lambda f: f.contact_load.tolist())
    robots = np.flatnonzero(drawing.robots)[: MOST_CURVES - 1]
    others = np.setdiff1d(np.arange(many), robots)
    curves = tuple(zip([*(drawing.names[i] for i in robots), "largest of the others"], CURVES, strict=False))

    def read(frame: PageFrame) -> list[float]:
        """Load of each robot, and the largest of all else."""
        return [*frame.contact_load[robots].tolist(), float(np.max(frame.contact_load[others], initial=0.0))]

    return Panel("Contact load [pN]", curves, lines, read)


def _distance(drawing: Drawing) -> Panel | None:
    traps = [k for k, trap in enumerate(drawing.traps) if trap.held >= 0]
    if not traps:
        return None
    reach = min(drawing.traps[k].reach for k in traps)
    lines = [(f"reach {reach:.3g} µm", reach, _RED)] if math.isfinite(reach) else []
    if math.isfinite(drawing.distance_warning):
        lines.append((f"warning {drawing.distance_warning:g} µm", drawing.distance_warning, _AMBER))
    if len(traps) <= MOST_CURVES:
        curves = tuple((drawing.traps[k].name, CURVES[i]) for i, k in enumerate(traps))
        return Panel("Trap to sphere [µm]", curves, tuple(lines), lambda f: f.trap_distance[traps].tolist())

    def read(frame: PageFrame) -> list[float]:
        """The largest of all traps."""
        return [float(np.max(np.nan_to_num(frame.trap_distance[traps]), initial=0.0))]

    return Panel("Trap to sphere [µm]", ((f"largest of {len(traps)}", CURVES[0]),), tuple(lines), read)


class Plots:
    """The plots of a page, in a container of viser's GUI; rebuilt when other hands have devices."""

    def __init__(self, gui: viser.GuiApi, place: Any, drawing: Drawing, height: int = 150):
        self._gui, self._place, self._drawing, self._height = gui, place, drawing, height
        self._hands: tuple[str, ...] | None = None
        self._charts: list[tuple[Panel, History, Any]] = []
        self._pushed = -math.inf

    def update(self, frame: PageFrame, now: float) -> None:
        """Note a frame; push it to the browsers when it is time to."""
        hands = tuple(hand.name for hand in frame.hands)
        if hands != self._hands:
            self._build(hands)
        for panel, history, _ in self._charts:
            history.add(now, panel.read(frame))
        if now - self._pushed >= PUSH:
            self._pushed = now
            for panel, history, chart in self._charts:
                chart.data = series_data(panel, history)

    def _build(self, hands: tuple[str, ...]) -> None:
        for _, _, chart in self._charts:
            chart.remove()
        self._hands, self._charts = hands, []
        with self._place:
            for panel in panels(self._drawing, hands):
                history = History(len(panel.curves))
                chart = self._gui.add_uplot(
                    series_data(panel, history), series=styles(panel), **layout(panel, self._height)
                )
                self._charts.append((panel, history, chart))


def series_data(panel: Panel, history: History) -> tuple[np.ndarray, ...]:
    """Arrays for viser: time, curves, lines; from the first value on, a gap filled with the value before it.

    uPlot takes a nan for a number and loses the scale of its axis; a gap that it knows cannot be told in an array.
    """
    time, values = history.arrays()
    known = np.isfinite(values)
    first = int(np.argmax(known.any(axis=0))) if known.any() else len(time) - 1
    last = np.maximum.accumulate(np.where(known, np.arange(len(time)), 0), axis=1)
    filled = np.nan_to_num(np.take_along_axis(values, last, axis=1))
    time, values = time[first:], filled[:, first:]
    return (time, *values, *(np.full(len(time), height) for _, height, _ in panel.lines))


def styles(panel: Panel) -> tuple[Any, ...]:
    """Series of uPlot: curves solid, lines dashed."""
    curves = [
        {"label": label, "stroke": colour, "width": 1.5, "points": {"show": False}} for label, colour in panel.curves
    ]
    lines = [
        {"label": label, "stroke": colour, "width": 1.25, "dash": (6, 4), "points": {"show": False}}
        for label, _, colour in panel.lines
    ]
    return ({"label": "s"}, *curves, *lines)


def layout(panel: Panel, height: int) -> dict[str, Any]:
    """Options of a chart on the dark page."""
    grey, faint = "#9fb0c4", "rgba(160,180,205,0.13)"
    axis = {"stroke": grey, "grid": {"stroke": faint, "width": 1}, "ticks": {"stroke": faint, "size": 4}}
    low = {"time": False, "range": (-SPAN, 0.0)}
    return {
        "title": panel.title,
        "scales": {"x": low},
        "axes": ({**axis, "size": 26}, {**axis, "size": 46}),
        "legend": {"show": True, "live": False},
        "height": height,
        "padding": (6, 10, 0, 0),
    }
