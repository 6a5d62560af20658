"""`python -m benchmarks.printed RESULT.txt …`: what benchmarks printed on another machine, put on their pages.

A GPU machine need not have the repository's history: there `OTWARP_COMMIT=… python -m benchmarks.NAME --device cuda:0 >
NAME.txt`, here this, which rewrites the headlines as well.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from benchmarks import headlines
from benchmarks.report import PAGES, check_places, put_text, run, save_page
from otwarp.errors import InputError

HEAD = re.compile(r"^`python -m benchmarks\.(\w+)([^`]*)` on .*$", re.MULTILINE)
"""The line with which a section begins: its benchmark, options, machine."""


def sections_of(text: str, where: str) -> list[tuple[str, str, str]]:
    """Name, kind (`cpu` or `cuda`) and text of each section that was printed.

    Args:
        text: The output; what was printed before the first section is left out.
        where: It is from, for the message.

    Raises:
        InputError: It has no section.
    """
    heads = list(HEAD.finditer(text))
    if not heads:
        raise InputError(f"{where} has no section of a benchmark; allowed: what python -m benchmarks.NAME prints")
    ends = [head.start() for head in heads[1:]] + [len(text)]
    return [
        (head[1], "cuda" if "--device cuda" in head[2] else "cpu", text[head.start() : end].strip() + "\n")
        for head, end in zip(heads, ends, strict=True)
    ]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Put what benchmarks printed elsewhere on their pages.")
    parser.add_argument("files", nargs="+", type=Path, metavar="RESULT.txt", help="output of benchmarks")
    pages: dict[Path, str] = {}
    for file in parser.parse_args().files:
        try:
            text = file.read_text(encoding="utf-8")
        except OSError as error:
            raise InputError(f"{file} cannot be read: {error.strerror}") from error
        for name, kind, printed in sections_of(text, str(file)):
            page = PAGES / f"{name}.md"
            if not page.is_file():
                raise InputError(f"{file} is of benchmarks.{name}, which has no page; allowed: one of docs/benchmarks")
            pages[page] = put_text(pages.get(page) or page.read_text(encoding="utf-8"), name, kind, printed)
    check_places(None, [*pages, headlines.SUMMARY])
    for page, text in pages.items():
        save_page(page, text)
    headlines.write()
    print(f"wrote {', '.join(f'docs/benchmarks/{page.name}' for page in pages)}")


if __name__ == "__main__":
    run(main)
