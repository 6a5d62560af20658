"""What a session was like, for its end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from otwarp.record.summary import statistics, strict, task

if TYPE_CHECKING:
    from otwarp.teleop.session.live import LiveLoop


def summarize(loop: LiveLoop) -> dict[str, Any]:
    """Figures of a session that has run; `text` says them to a reader.

    Keys: `wall` and `simulated` [s], `slipped` [s], `real_time_factor` over the whole session, `paused` [s], `frames`,
    `late_frames`, `servo` (cycles, dropped, worst lateness of its last second [s]), `hands`, `failure`, `text`; of the
    time since the last reset, as `otwarp run` has them, `task` and `statistics`.
    """
    pace, status = loop.pace, loop.hands.status
    running = loop.wall - pace.stood
    report: dict[str, Any] = {
        "wall": loop.wall,
        "simulated": pace.simulated,
        "slipped": pace.slipped,
        "paused": pace.stood,
        "real_time_factor": pace.simulated / running if running > 0.0 else 0.0,
        "frames": loop.frames,
        "late_frames": loop.late,
        "servo": None,
        "hands": [],
        "failure": loop.failure or None,
        "task": strict(task(loop.monitor, 1)),
        "statistics": strict(statistics(loop.monitor)),
    }
    lines = [
        f"session   {loop.wall:.1f} s, {pace.simulated:.2f} s simulated "
        f"({report['real_time_factor']:.2f} of real time{_slip(pace.slipped)}), "
        f"{loop.frames} frames, {loop.late} of them late"
    ]
    if status is not None:
        report["servo"] = {"cycles": status.tick, "dropped": status.late, "lateness": status.lateness}
        lines.append(
            f"servo     {status.tick} cycles, {status.late} dropped, in its last second at most "
            f"{1e3 * status.lateness:.2f} ms late"
        )
    for n, hand in enumerate(loop.hands.frames):
        losses = status.hands[n].losses if status else 0
        report["hands"].append({"name": hand.name, "device": hand.device, "losses": losses, "message": hand.message})
        lines.append(f"{hand.name:<9} {hand.device}: lost {losses} times{'; ' + hand.message if hand.message else ''}")
    lines += _task_lines(loop)
    if loop.failure:
        lines.append(f"stopped   {loop.failure}")
    report["text"] = "\n".join(lines)
    return report


def _task_lines(loop: LiveLoop) -> list[str]:
    """How the task ended, and the figures that the paper gives of a trial."""
    monitor = loop.monitor
    ended, numbers = monitor.outcome(0), statistics(monitor)
    lines = [] if monitor.goal is None else [f"task      {ended.outcome}: {ended.reason}"]
    for name, key in (("distance", "trap_distance"), ("contact", "contact_force")):
        part = numbers.get(key)
        if part and part.get("mean") is not None:
            lines.append(f"{name:<9} {part['mean']:.3g} ± {part['std']:.2g} {part['unit']}")
    return lines


def _slip(seconds: float) -> str:
    return f", {seconds:.2f} s given up" if seconds > 0.0 else ""
