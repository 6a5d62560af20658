"""The tables that `otwarp haptics check` prints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from otwarp.haptics.check import Advised, CallCost, Check, FoundDevices
from otwarp.haptics.check.timing import STATE_RATE, Jitter, Percentiles, ServoLatency
from otwarp.haptics.check.zwidth import DEVICE, FeltLimit, Width

if TYPE_CHECKING:
    from rich.table import Table

PERCENTILES = ("p50", "p99", "p99.9", "max")


def _table(title: str, *columns: str, right: Sequence[str] = ()) -> Table:
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for column in columns:
        table.add_column(column, justify="right" if column in right else "left", overflow="fold")
    return table


def micro(spread: Percentiles) -> tuple[str, ...]:
    """Percentiles of a time [s] in µs."""
    return tuple(f"{1e6 * v:.3g}" for v in (spread.p50, spread.p99, spread.p999, spread.max))


def device_table(found: Sequence[FoundDevices]) -> Table:
    """Kinds of devices and what is there."""
    from rich.text import Text

    table = _table("Devices", "kind", "found")
    for one in found:
        lines = "\n".join(one.found) or one.trouble or ("always there: software" if one.software else "none")
        table.add_row(one.kind, Text(lines))
    return table


def grant_table(grants: Sequence[Advised]) -> Table:
    """What the system gave, and what to do about the rest."""
    from rich.text import Text

    table = _table("What the system gives a servo", "what", "granted", "in force, or why not", "what helps")
    for one in grants:
        grant = one.grant
        table.add_row(grant.what, "yes" if grant.granted else "no", Text(grant.detail), Text(one.advice))
    return table


def latency_table(latency: ServoLatency) -> Table:
    """Times in the servo process [µs]: from a sample, and from a published state, to the force that knows of it."""
    title = f"Latency in the servo process [µs], {latency.device}, {latency.cycles} cycles, {latency.late} dropped"
    table = _table(title, "from", "to", *PERCENTILES, right=PERCENTILES)
    table.add_row("sample of the hand", "force to the device", *micro(latency.sample))
    table.add_row(f"state published ({STATE_RATE:g}/s)", "first force that knows it", *micro(latency.state))
    return table


def cost_table(costs: Sequence[CallCost]) -> Table:
    """What one call of each function costs [µs], by percentiles."""
    table = _table("Cost of one call [µs]", "call", *PERCENTILES, right=PERCENTILES)
    for cost in costs:
        table.add_row(cost.what, *micro(cost.time))
    return table


def width_table(found: Sequence[Width]) -> Table:
    """Z-width, ours beside theory and paper."""
    right = ("spring [N/m]", "reference [N/m]")
    table = _table(f"Z-width of a bare device ({DEVICE}), virtual clock", "loop", *right, "reference is", right=right)
    for one in found:
        value = f"≥ {one.found:.0f}" if one.open_ended else f"{one.found:.4g}"
        table.add_row(one.loop, value, "" if one.reference is None else f"{one.reference:g}", one.source)
    return table


def limit_table(found: Sequence[FeltLimit]) -> Table:
    """Limits of what an operator feels, each with the reason."""
    table = _table("What is limited, and why (the Touch's preset)", "what", "to", "why")
    for one in found:
        table.add_row(one.what, one.value, one.why)
    return table


def check_tables(check: Check) -> list[Table]:
    """All tables in their order."""
    tables = [device_table(check.devices), grant_table(check.grants), jitter_table(check.jitter)]
    if check.latency is not None:
        tables.append(latency_table(check.latency))
    tables.append(cost_table(check.costs))
    if check.widths:
        tables.append(width_table(check.widths))
    return [*tables, limit_table(check.limits)]


def jitter_table(measured: Sequence[Jitter]) -> Table:
    """A table to print: one row per measurement, times in µs."""
    from rich.table import Table

    table = Table(title="Loop jitter [µs]")
    for column in ("rate [Hz]", "beside", "spin", "what", "p50", "p99", "p99.9", "max", "skipped", "granted"):
        table.add_column(column, justify="left" if column in ("beside", "what", "granted") else "right")
    for one in measured:
        beside = f"{one.busy} busy" if one.busy else "idle"
        granted = ", ".join(f"{g.what} {g.detail}" for g in one.grants if g.granted) or "nothing"
        front = (f"{one.rate:g}", beside, f"{1e6 * one.spin:g}")
        for what, spread in (("period", one.period), ("lateness", one.lateness)):
            numbers = (f"{1e6 * v:.0f}" for v in (spread.p50, spread.p99, spread.p999, spread.max))
            ends = (str(one.skipped), granted) if what == "period" else ("", "")
            table.add_row(*(front if what == "period" else ("", "", "")), what, *numbers, *ends)
    return table
