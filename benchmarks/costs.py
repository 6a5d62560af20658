"""What scenes cost: `otwarp bench me` on this machine, put on docs/costs.md with its picture by `--write`."""

from __future__ import annotations

from pathlib import Path

from benchmarks.report import Section, check_places, options, put_on_page, run, save_json, save_page
from otwarp.bench.machine import Machine
from otwarp.bench.me.figure import draw
from otwarp.bench.me.measure import MyBench, bench_me
from otwarp.bench.me.table import table

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE, PICTURE = DOCS / "costs.md", DOCS / "images" / "costs.png"


def section(found: MyBench) -> Section:
    """The table of what was found."""
    return Section(
        name="costs", kind=found.kind, machine=Machine(**found.machine), tables=[table(found)], data=found.json()
    )


def main() -> None:
    """Command line."""
    parser = options("What scenes cost.", rounds=5)
    parser.add_argument("--write", action="store_true", help="put table and picture on docs/costs.md")
    asked = parser.parse_args()
    check_places(asked.out, (PAGE, PICTURE) if asked.write else ())
    found = bench_me((), asked.device, rounds=asked.rounds)
    made = section(found)
    print(made.markdown())
    if asked.out:
        save_json(asked.out, [made])
    if asked.write:
        save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), made))
        if found.kind == "cpu":
            draw(found, PICTURE)


if __name__ == "__main__":
    run(main)
