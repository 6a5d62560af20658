"""The report: `report.html`, in which everything is, and `numbers.json` and `numbers.csv` for programs."""

from __future__ import annotations

import base64
import csv
import html
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from otwarp import __version__
from otwarp.files import written
from otwarp.reproduce.item import GRADES, Comparison, Table
from otwarp.reproduce.numbering import FIGURES, PAIR, TABLES, numbers_said
from otwarp.reproduce.parts import Part, by_machine, how_long, where
from otwarp.reproduce.registry import ITEMS
from otwarp.reproduce.sheet import SHEET
from otwarp.reproduce.store import Done, Store, write_json

PAPER = (
    "Tan, Wei and Zhang, “A Digital Twin Framework for Virtual Visuo-Haptic Teleoperation of Complex-Shaped Optical "
    "Microrobots” (Imperial College London), and its public release"
)

LEDE = f"""Every table and figure of {PAPER}, ours beside theirs. What is theirs is <span
class="theirs">vermilion</span>, what is ours <span class="ours">blue</span>; a badge says how well a figure of theirs
is known. SE is a standard error, brackets hold 95 % intervals, ± after a mean is the spread of what it is the mean
of. Figures and tables have numbers of this report, which are not the paper's."""

PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>The paper, reproduced</title>
<style>{sheet}</style>
</head>
<body>
<nav aria-label="Items"><p class="brand">otwarp <span>{version}</span></p><ol>{links}</ol></nav>
<main>
<header>
<h1>The paper, reproduced</h1>
<p class="lede">{lede}</p>
<p class="kind {kind}">{kind_text}</p>
<dl class="grades">{grades}</dl>
</header>
{summary}
{sections}
{times}
<footer><p>otwarp {version}, seed {seed}. Series (CSV) and figures (PNG) lie in <code>items/</code> beside this file,
all numbers in <code>numbers.json</code> and <code>numbers.csv</code>.</p></footer>
</main>
</body>
</html>
"""

QUICK = """Quick report: fewer trials, a reduced network table. Each item says how much was computed; without
<code>--quick</code> the same items run in full."""
FULL = "Full report."


def write_report(store: Store, done: Sequence[Done], missing: Mapping[str, str]) -> Path:
    """Write the page and the numbers.

    Args:
        store: Where.
        done: Items that are there.
        missing: Items that could not be computed → why.

    Returns:
        The page.
    """
    page = store.folder / "report.html"
    with written(page) as part:
        part.write_text(html_page(store, done, missing), encoding="utf-8")
    about = {"otwarp": __version__, "quick": store.quick, "seed": store.seed, "seconds": by_machine(all_parts(done))}
    items = {
        one.name: {
            "title": one.title,
            "device": one.device,
            "machine": where(one.parts),
            "seconds": one.seconds,
            "parts": [asdict(part) for part in one.parts],
            **one.result.said(),
        }
        for one in done
    }
    write_json(store.folder / "numbers.json", {**about, "items": items, "missing": dict(missing)})
    with written(store.folder / "numbers.csv") as part:
        part.write_text(csv_text(done), encoding="utf-8")
    return page


def html_page(store: Store, done: Sequence[Done], missing: Mapping[str, str]) -> str:
    """The whole page, figures embedded."""
    names = {one.name: one for one in done}
    links = "".join(
        f'<li><a href="#{name}" class="{"there" if name in names else "absent"}">{text(item.title)}</a></li>'
        for name, item in ITEMS.items()
    )
    sections = [
        section(names[name]) if name in names else absent(name, item.title, item.about, missing.get(name, ""))
        for name, item in ITEMS.items()
    ]
    kind = "quick" if store.quick else "full"
    grades = "".join(f'<dt><b class="grade {g}">{g}</b></dt><dd>{text(said)}</dd>' for g, said in GRADES.items())
    return PAGE.format(
        sheet=SHEET,
        version=__version__,
        links=links,
        lede=LEDE,
        kind=kind,
        kind_text=QUICK if store.quick else FULL,
        grades=grades,
        summary=summary(done),
        sections="\n".join(sections),
        times=times(done),
        seed=store.seed,
    )


def summary(done: Sequence[Done]) -> str:
    """The figures that matter most, of all items."""
    rows = [
        (f'<a href="#{one.name}">{text(one.title)}</a>' if row == keys[0] else "", row)
        for one in done
        for keys in [[row for row in one.result.comparisons if row.key]]
        for row in keys
    ]
    if not rows:
        return ""
    lines = "".join(f"<tr><td>{link}</td>{''.join(_cells(row))}</tr>" for link, row in rows)
    head = '<th></th><th></th><th class="theirs">paper</th><th class="ours">otwarp</th><th></th>'
    whole = f'<table class="pair"><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>'
    return f'<section id="summary"><h2>At a glance</h2><div class="scroll">{whole}</div></section>'


def section(one: Done) -> str:
    """An item that is done."""
    found = one.result
    figures = "".join(
        f'<figure id="fig{n}"><img alt="{plain(f.caption)}" src="{_embedded(one.folder / f.file)}">'
        f"<figcaption><b>Figure {n}.</b> {text(f.caption)}</figcaption></figure>"
        for n, f in zip(FIGURES[one.name], found.figures, strict=True)
    )
    first, *others = TABLES[one.name]
    tables = "".join(table(t, n) for n, t in zip(others, found.tables, strict=True))
    facts = {**found.computed, "device": one.device, "time": how_long(one.parts), "machine": where(one.parts),
             "code": one.code.said()}  # fmt: skip
    computed = "".join(f"<dt>{text(key)}</dt><dd>{text(value)}</dd>" for key, value in facts.items())
    limits = "".join(f"<li>{text(line)}</li>" for line in found.incomparable)
    files = "".join(f"<li><code>items/{one.name}/{name}</code> {text(what)}</li>" for name, what in found.files.items())
    return f"""<section id="{one.name}">
<h2>{text(one.title)}</h2>
<p class="about">{text(one.about)}</p>
{comparisons(found.comparisons, first)}
{figures}
<div class="words"><div><h3>What is compared</h3><p>{text(found.definition)}</p></div>
<div><h3>Why they differ</h3><p>{text(found.difference)}</p></div></div>
{f'<div class="limits"><h3>What cannot be compared</h3><ul>{limits}</ul></div>' if limits else ""}
{tables}
<details><summary>How it was computed</summary><dl class="facts">{computed}</dl>
{f"<ul>{files}</ul>" if files else ""}</details>
</section>"""


def all_parts(done: Sequence[Done]) -> list[Part]:
    """Of all items."""
    return [part for one in done for part in one.parts]


def took(done: Sequence[Done]) -> str:
    """How long all items took, on what, and in how many calls of the command, in words."""
    machines = by_machine(all_parts(done))
    told = [f"{seconds:.0f} s on {machine}" for machine, seconds in machines.items()]
    whole = f"{sum(machines.values()):.0f} s in all: " if len(told) > 1 else ""
    return (f"{len(done)} of {len(ITEMS)} items, one after the other, wall time: {whole}{'; '.join(told)}. "
            f"{_calls(done)}")  # fmt: skip


def _calls(done: Sequence[Done]) -> str:
    calls = sorted({part.call for part in all_parts(done)})
    if len(calls) < 2:
        return f"Computed in one call of the command, begun {_minute(calls[0])}." if calls else ""
    cut = [f"{one.title} ({len(one.parts)})" for one in done if len(one.parts) > 1]
    said = f"Computed in {len(calls)} calls of the command, the first begun {_minute(calls[0])}, the last "
    said += f"{_minute(calls[-1])}."
    if not cut:
        return f"{said} No item was interrupted."
    return (f"{said} Interrupted, and gone on with in so many parts: {', '.join(cut)}; their times are those of all "
            "parts together, what an interruption lost included.")  # fmt: skip


def _minute(call: str) -> str:
    return f"{call[:10]} {call[11:16]} UTC"


def whose(done: Sequence[Done]) -> str:
    """Which code computed the items, in words."""
    titles: dict[str, list[str]] = {}
    for one in done:
        titles.setdefault(one.code.said(), []).append(one.title)
    if len(titles) < 2:
        return f"Code: {next(iter(titles), 'none')} (SHA-256 of package and scenes)."
    parts = [f"{said} computed {', '.join(names)}" for said, names in titles.items()]
    return f"These items are not of one code: {'; '.join(parts)}."


def times(done: Sequence[Done]) -> str:
    """Wall time of each item, and of all, and whose code it was."""
    if not done:
        return ""
    rows = tuple((one.title, f"{one.seconds:.1f}", one.device) for one in done)
    whole = ("together", f"{sum(one.seconds for one in done):.1f}", "")
    shown = table(
        Table(title="Wall time", head=("item", "s", "device"), rows=(*rows, whole), note=f"{took(done)} {whose(done)}")
    )
    return f'<section id="times"><h2>How long it took</h2>{shown}</section>'


def absent(name: str, title: str, about: str, why: str) -> str:
    """An item that is not there."""
    said = f"Not computed: {text(why)}." if why else "Not computed yet."
    return f"""<section id="{name}" class="absent"><h2>{text(title)}</h2><p class="about">{text(about)}</p>
<p class="missing">{said} <code>otwarp reproduce --out … --only {name}</code> computes {numbers_said(name)}.</p>
</section>"""


def comparisons(rows: Sequence[Comparison], number: int) -> str:
    """Theirs and ours, side by side, as the table of that number."""
    lines = [f"<tr>{''.join(_cells(row))}</tr>" for row in rows]
    return (f'<h3 id="table{number}">Table {number}. {PAIR}</h3>'
            '<div class="scroll"><table class="pair"><thead><tr><th></th><th class="theirs">paper</th>'
            '<th class="ours">otwarp</th><th></th></tr></thead>'
            f"<tbody>{''.join(lines)}</tbody></table></div>")  # fmt: skip


def _cells(row: Comparison) -> tuple[str, ...]:
    unit = f' <span class="unit">{text(row.unit)}</span>' if row.unit else ""
    badge = f' <b class="grade {row.grade}" title="{plain(GRADES[row.grade])}">{row.grade}</b>' if row.grade else ""
    return (
        f'<th scope="row">{text(row.what)}{unit}</th>',
        f'<td class="theirs">{text(row.paper.said())}{badge}</td>',
        f'<td class="ours">{text(row.ours.said())}</td>',
        f'<td class="remark">{text(row.remark)}</td>',
    )


def table(one: Table, number: int | None = None) -> str:
    """Another table, which has a number if it is an item's."""
    named = "<h3>" if number is None else f'<h3 id="table{number}">Table {number}. '
    head = "".join(f"<th>{text(cell)}</th>" for cell in one.head)
    body = "".join(
        f'<tr><th scope="row">{text(row[0])}</th>{"".join(f"<td>{text(cell)}</td>" for cell in row[1:])}</tr>'
        for row in one.rows
    )
    note = f'<p class="note">{text(one.note)}</p>' if one.note else ""
    return (f'{named}{text(one.title)}</h3><div class="scroll"><table class="more"><thead><tr>{head}</tr></thead>'
            f"<tbody>{body}</tbody></table></div>{note}")  # fmt: skip


def text(words: str) -> str:
    """Words as HTML; what stands between backticks is code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(" ".join(words.split()), quote=True))


def plain(words: str) -> str:
    """Words for an attribute of HTML, which holds no elements: without backticks."""
    return html.escape(" ".join(words.replace("`", "").split()), quote=True)


def _embedded(file: Path) -> str:
    """A picture as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode("ascii")


def csv_text(done: Sequence[Done]) -> str:
    """All comparisons, a row each."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(["item", "what", "unit", "paper", "paper_text", "grade", "ours", "ours_spread", "ours_standard_error",
                   "ours_low", "ours_high", "ours_text", "remark"])  # fmt: skip
    for one in done:
        for row in one.result.comparisons:
            low, high = row.ours.interval or ("", "")
            numbers = [v if v is not None else "" for v in (row.ours.number, row.ours.spread, row.ours.error)]
            rows.writerow([one.name, row.what, row.unit, "" if row.paper.number is None else row.paper.number,
                           row.paper.said(), row.grade, *numbers, low, high, row.ours.said(), row.remark])  # fmt: skip
    return out.getvalue()
