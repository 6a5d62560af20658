"""`reproduce`: items one after the other, those that are done kept; the report anew after each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.files import claimed
from otwarp.reproduce.code import code_here
from otwarp.reproduce.item import Item, Request, Unavailable, scene_file
from otwarp.reproduce.numbering import chosen
from otwarp.reproduce.parts import PARTS, Part, check_code, read_parts, timed
from otwarp.reproduce.registry import ITEMS
from otwarp.reproduce.report import write_report
from otwarp.reproduce.store import Done, Store, open_store, read_head


@dataclass(frozen=True)
class Report:
    """What a call came to.

    Attributes:
        page: The HTML file.
        done: Items that are there, in the report's order.
        missing: Name of each item that was asked for and could not be computed here → why.
    """

    page: Path
    done: tuple[Done, ...]
    missing: dict[str, str]


def reproduce(
    out: str | Path,
    *,
    names: Sequence[str] = (),
    quick: bool = False,
    device: str | None = None,
    scenes: str | Path = "scenes",
    seed: int = 0,
    say: Callable[[str], None] = lambda line: None,
) -> Report:
    """Compute the paper's tables and figures, ours beside theirs, and write them as one page.

    An item that is done is kept; one that was interrupted begins anew, or goes on where it keeps parts.

    Args:
        out: Folder of the report; see `otwarp.reproduce.store`.
        names: Of the items, or `fig6`, `table2` for those of the report with these numbers; none for all.
        quick: In minutes on two cores, with fewer trials; the report says how many.
        device: cpu, cuda:0, …; None for the best there is.
        scenes: Folder of the shipped scenes.
        seed: Of all random numbers.
        say: Called with what is being done; it may raise to end the call.

    Raises:
        InputError: An unknown item, a folder that cannot be written or holds something else, a scene that is missing.
        SimulationError: A run stopped because its state was no longer physical.
    """
    items = chosen(names)
    pick(device)
    for name in {scene for item in items for scene in item.scenes}:
        scene_file(Path(scenes), name)
    store = open_store(Path(out), quick=quick, seed=seed)
    part = begun_by(device, Path(scenes))
    missing: dict[str, str] = {}
    with claimed(store.folder, "writes this report; allowed: one at a time"):
        for number, item in enumerate(items, 1):
            if store.has(item.name):
                say(f"{item.name} is done ({number} of {len(items)})")
                store.tidy(item.name)  # the last process may have been killed between the two
                continue
            say(f"{item.name} ({number} of {len(items)})")
            try:
                _compute(store, item, part(), device, Path(scenes), say)
            except Unavailable as error:
                missing[item.name] = str(error)
                say(f"{item.name} is left out: {error}")
                continue
            _write(store, {})
        page, done = _write(store, missing)
    return Report(page, done, missing)


def pick(device: str | None) -> Any:
    """The device of Warp, checked before anything is written."""
    from otwarp.device import pick_device

    return pick_device(device)


def _compute(
    store: Store, item: Item, part: Part, device: str | None, scenes: Path, say: Callable[[str], None]
) -> None:
    """One item, into the store."""
    work = store.work_folder(item.name)
    before = read_parts(work / PARTS)
    check_code(before, part.code, work)
    with timed(work / PARTS, before, part) as parts, store.making(item, parts) as (folder, found):
        request = Request(quick=store.quick, device=device, scenes=scenes, seed=store.seed, folder=folder,
                          work=work, say=lambda line: say(f"{item.name}: {line}"))  # fmt: skip
        result = item.run(request)
        shown = len(result.figures), 1 + len(result.tables)
        assert shown == (item.figures, item.tables), f"{item.name} has {shown} figures and tables: numbers would shift"
        found.append(result)
    store.tidy(item.name)


def begun_by(device: str | None, scenes: Path) -> Callable[[], Part]:
    """What makes the parts of this call, nothing computed yet.

    Args:
        device: cpu, cuda:0, …; None for the best there is.
        scenes: Folder of the shipped scenes.
    """
    from otwarp.bench.machine import Machine

    there = pick(device)
    names = {name for item in ITEMS.values() for name in item.scenes}
    code = code_here(file for name in names if (file := scenes / f"{name}.usda").is_file())
    call = datetime.now(UTC).isoformat(timespec="milliseconds")

    def part() -> Part:
        """With the load of now."""
        return Part(call=call, code=code, device=str(there), machine=Machine.look(there).text(), seconds=0.0)

    return part


def _write(store: Store, missing: dict[str, str]) -> tuple[Path, tuple[Done, ...]]:
    done = tuple(store.read(name) for name in ITEMS if store.has(name))
    return write_report(store, done, missing), done


def done_in(folder: str | Path) -> tuple[Store, tuple[Done, ...]]:
    """The items of a report that is there.

    Raises:
        InputError: No report of this version.
    """
    head = read_head(Path(folder))
    store = Store(Path(folder), head["quick"], head["seed"])
    done = tuple(store.read(name) for name in ITEMS if store.has(name))
    if not done:
        raise InputError(f"--out is {folder}, in which no item is done; allowed: a report with one or more")
    return store, done
