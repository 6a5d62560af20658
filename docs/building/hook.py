"""What MkDocs calls while it builds the site (`hooks` of mkdocs.yml)."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # MkDocs loads this file by its path

from mkdocs.structure.files import File, Files

from docs.building import links, reference

HOW_TO = "How-to"
"""Part of the navigation that takes the pages of docs/ which mkdocs.yml does not place."""


def expand(nav: list[Any], pages: list[str]) -> list[Any]:
    """Navigation in which the name of a folder (`…/`) stands for all pages in it."""
    found: list[Any] = []
    for entry in nav:
        if isinstance(entry, str) and entry.endswith("/"):
            found += [{Path(page).stem: page} for page in pages if page.startswith(entry)]
        elif isinstance(entry, dict):
            found += [{name: expand(to, pages) if isinstance(to, list) else to} for name, to in entry.items()]
        else:
            found.append(entry)
    return found


def on_config(config: Any) -> Any:
    """Put the pages that are made here, and those of folders, into the navigation."""
    folders = ("benchmarks", "validation")
    written = [p.relative_to(links.DOCS).as_posix() for f in folders for p in sorted((links.DOCS / f).glob("*.md"))]
    made = reference.commands() | reference.python()
    config["nav"] = expand(config["nav"], [*made, *written])
    how_to = next(part[HOW_TO] for part in config["nav"] if HOW_TO in part)
    placed = str(config["nav"])
    how_to += [page.name for page in sorted(links.DOCS.glob("*.md")) if f"'{page.name}'" not in placed]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made here."""
    for uri, text in (reference.commands() | reference.python() | links.pages_outside()).items():
        files.append(File.generated(config, uri, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links out of docs/ lead to the pages that are made for them."""
    path = links.DOCS / page.file.src_uri
    return links.relink(markdown, path) if path.is_file() else markdown


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """Say nothing of defaults that click does not have; mkdocs-click 0.9 prints its word for that."""
    return html.replace("<code>Sentinel.UNSET</code>", "") if page.file.src_uri.startswith(reference.COMMANDS) else html


def on_post_page(output: str, **_: Any) -> str:
    """Name the search, a dialog without a name in Material for MkDocs 9.8, for those who hear the page."""
    return output.replace('role="dialog"', 'role="dialog" aria-label="Search"', 1)
