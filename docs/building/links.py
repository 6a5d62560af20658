"""Pages of the site for what lies outside docs/: README and its like as they are, sources as highlighted text."""

from __future__ import annotations

import os
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
OUTSIDE = "repository"
"""Folder of the site for what lies outside docs/."""

LINK = re.compile(r"(?<=\]\()([^()\s#]+)(?=[^()]*\))")
CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
LANGUAGES = {".py": "python", ".toml": "toml", ".usda": "text", ".json": "json"}
LARGEST = 100_000
"""Characters of a source that its page shows."""


def uri_of(path: Path) -> str:
    """Where a file or folder of the repository is in the site, as the name of a Markdown file.

    Args:
        path: Absolute.
    """
    if path.is_relative_to(DOCS) and path.suffix != ".py" and path.is_file():
        return path.relative_to(DOCS).as_posix()
    name = f"{OUTSIDE}/{path.relative_to(ROOT).as_posix()}"
    return f"{name}/contents.md" if path.is_dir() else name if path.suffix == ".md" else f"{name}.md"


def outside_code(text: str) -> list[tuple[str, bool]]:
    """Pieces of a page, each with whether links in it are links: not those of code."""
    pieces, at = [], 0
    for code in CODE.finditer(text):
        pieces += [(text[at : code.start()], True), (code.group(), False)]
        at = code.end()
    return [*pieces, (text[at:], True)]


def targets(text: str, path: Path) -> list[Path]:
    """Files and folders of the repository that the text of a file links to, absolute."""
    names = [name for piece, prose in outside_code(text) if prose for name in LINK.findall(piece)]
    found = [(path.parent / name).resolve() for name in names if not re.match(r"[a-z]+:", name)]
    return [target for target in found if target.is_relative_to(ROOT) and target.exists()]


def relink(text: str, path: Path) -> str:
    """The text of a page with links that hold in the site.

    Args:
        text: Markdown.
        path: The file that it comes from, which its links start at.
    """
    here = Path(uri_of(path)).parent

    def moved(match: re.Match[str]) -> str:
        target = (path.parent / match.group()).resolve()
        if re.match(r"[a-z]+:", match.group()) or not target.is_relative_to(ROOT) or not target.exists():
            return match.group()
        return os.path.relpath(uri_of(target), here)

    return "".join(LINK.sub(moved, piece) if prose else piece for piece, prose in outside_code(text))


def page_of(path: Path) -> str:
    """The Markdown of a page for a file or folder outside docs/."""
    if path.suffix == ".md":
        return relink(path.read_text(encoding="utf-8"), path)
    name = path.relative_to(ROOT).as_posix()
    head = f"---\nsearch:\n  exclude: true\n---\n\n# {name}\n\n"
    if path.is_dir():
        return head + "\n".join(f"- [{file.name}]({file.name}.md)" for file in sources_in(path)) + "\n"
    text = path.read_text(encoding="utf-8")
    cut = "" if len(text) <= LARGEST else f"\nThe first {LARGEST:,} of {len(text):,} characters.\n"
    return f"{head}````{LANGUAGES.get(path.suffix, 'text')}\n{text[:LARGEST]}\n````\n{cut}"


def sources_in(folder: Path) -> list[Path]:
    """Sources that the page of a folder lists."""
    return sorted(path for path in folder.iterdir() if path.suffix in LANGUAGES)


def pages_outside() -> dict[str, str]:
    """URI → Markdown of every page outside docs/ that pages of the site lead to."""
    waiting = [path for page in sorted(DOCS.rglob("*.md")) for path in targets(page.read_text(encoding="utf-8"), page)]
    pages: dict[str, str] = {}
    while waiting:
        path = waiting.pop()
        uri = uri_of(path)
        if uri in pages or not uri.startswith(f"{OUTSIDE}/"):
            continue
        pages[uri] = page_of(path)
        if path.is_dir():
            waiting += sources_in(path)
        elif path.suffix == ".md":
            waiting += targets(path.read_text(encoding="utf-8"), path)
    return pages
