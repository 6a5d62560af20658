"""Texts of the page: task and warnings, the state of each hand, the figures of the loop. HTML, all escaped."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence

from otwarp.teleop.core.frame import HandFrame, PaceNow
from otwarp.teleop.page.messages import PageFrame

QUIET = 6.0
"""Seconds after which the same warning, whatever its numbers, is notified again if it had gone meanwhile."""
MOST_SHOWN = 6
LONGEST_DEVICE = 30
"""Characters of a device's name that fit on its row; the pointer shows the whole of a longer one."""
KEEPS_UP = 0.95
"""Share of the wanted pace below which the figures turn amber."""
_RED, _AMBER, _GREEN, _GREY = "#ff405c", "#ffc24a", "#4ade80", "#8ea2b8"
STATE_COLOURS = {"armed": _GREEN, "ramping": _AMBER, "decaying": _AMBER, "fault": _RED, "disarmed": _GREY}


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
    return table(rows)


def table(rows: Sequence[tuple[str, str]]) -> str:
    """Rows of name and value; values are HTML already."""
    body = "".join(
        f'<tr><td style="color:{_GREY};padding:1px 12px 1px 0;white-space:nowrap">{_escape(name)}</td>'
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
