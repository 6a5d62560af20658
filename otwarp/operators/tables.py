"""What a study of SIMULATED operators has found, line by line."""

from __future__ import annotations

from typing import Any

from otwarp.operators.summary import MEASURES

MOST = 6
"""Parameters of which Sobol indices are printed, the largest first."""


def comparison_lines(found: dict[str, Any]) -> list[str]:
    """Differences of conditions, small studies and the literature, of a `summary.summarise`."""
    lines = []
    for name, row in found["compared"].items():
        said = f"success, {name}: {ends(row['risk difference'], '+.3f')}, p = {row['p']:.2g}"
        lines.append(f"{said} ({row['better']} operators better, {row['worse']} worse), g = {row['g of success']:+.2f}")
        both = row["g where both delivered"]
        for measure, (meaning, _) in MEASURES.items():
            said = [ends(row["g"][measure], "+.2f")] if measure in row["g"] else []
            said += [f"where both delivered {ends(both[measure], '+.2f')}"] if measure in both else []
            if said:
                lines.append(f"  g of {meaning}: {'; '.join(said)}")
    if "small study" in found:
        small = found["small study"]
        lines.append(
            "10 + 10 of these simulated trials show at least 8 against at most 3 with probability "
            f"{ends(small['at least 8 and at most 3 of 10'], '.3g')}, exactly 8 against 3 with {small['exactly']:.2g}"
        )
    paper = found["paper"]
    lines.append(f"people: the paper's 8/10 against 3/10, g = {paper['g of success']:+.2f}")
    lines += [f"people: {name}: g = {ends(row, '+.2f')}" for name, row in found["literature"].items()]
    return lines


def sobol_lines(found: dict[str, Any], most: int = MOST) -> list[str]:
    """The `most` largest total indices of each number that was asked, of a `summary.summarise` with Sobol indices."""
    lines = []
    for name, row in found.get("sobol", {}).get("indices", {}).items():
        totals = [(t if t is not None else 0.0, n) for n, t in enumerate(row["total"])]
        for total, n in sorted(totals, reverse=True)[:most]:
            first = row["first"][n] or 0.0
            errors = row["first_error"][n] or 0.0, row["total_error"][n] or 0.0
            lines.append(
                f"Sobol, {name}: {found['sobol']['parameters'][n]} first {first:.2f} ± {errors[0]:.2f}, "
                f"total {total:.2f} ± {errors[1]:.2f}"
            )
    return lines


def ends(row: dict[str, Any], form: str) -> str:
    """A number with the ends of its interval, where it has one."""
    if row["value"] is None:
        return "not defined"
    value = f"{row['value']:{form}}"
    return value if row.get("low") is None else f"{value} [{row['low']:{form}}, {row['high']:{form}}]"
