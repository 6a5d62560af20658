"""What the documents of this repository hold: links, headings, blocks of code, inline code."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Document:
    """One Markdown file."""

    path: Path

    def __str__(self) -> str:
        return self.path.relative_to(ROOT).as_posix()

    @property
    def text(self) -> str:
        return self.path.read_text(encoding="utf-8")

    @property
    def prose(self) -> str:
        """The text without its blocks of code and comments."""
        return re.sub(r"<!--.*?-->", "", FENCE.sub("", self.text), flags=re.DOTALL)

    def blocks(self, language: str) -> list[str]:
        """Blocks of code; `""` are those of no language."""
        return [body for name, body in FENCE.findall(self.text) if name == language]

    def links(self) -> list[str]:
        """Targets of links and images that are not addresses."""
        prose = re.sub(r"`[^`\n]*`", "", self.prose)
        return [t for t in re.findall(r"\]\(([^()\s]+)\)", prose) if not re.match(r"[a-z]+:", t)]

    def inline(self) -> list[str]:
        """Inline code."""
        return re.findall(r"`([^`\n]+)`", self.prose)

    def anchors(self) -> set[str]:
        """What `#…` may name: headings as GitHub turns them into anchors."""
        titles = re.findall(r"^#+ (.*)$", self.prose, re.MULTILINE)
        return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}

    def commands(self, program: str) -> list[str]:
        """Lines of shell that begin with the program: continued lines joined, comments and redirections taken off."""
        lines = "\n".join(self.blocks("") + self.blocks("bash")).replace("\\\n", " ").splitlines()
        return [re.sub(r"\s+(#|>|\|) .*$", "", line) for line in lines if line.split()[:1] == [program]]


DOCUMENTS = [
    Document(path)
    for path in sorted(
        [
            ROOT / "README.md",
            ROOT / "CHANGELOG.md",
            ROOT / "CONTRIBUTING.md",
            *(ROOT / "benchmarks").rglob("*.md"),
            *(ROOT / "docs").rglob("*.md"),
            *(ROOT / "examples").rglob("*.md"),
        ]
    )
]
