"""The code that computes a report: its commit where that is known, and a digest of its files and scenes in any case."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import otwarp
from otwarp.bench.commit import commit_of

ENDINGS = (".py", ".toml", ".json", ".usda")
"""Of files of the package that results may follow from."""


@dataclass(frozen=True, kw_only=True)
class Code:
    """What results follow from, besides the options.

    Attributes:
        commit: With a + where files differ from it; empty where it is not known.
        digest: Of the files of the package and of the scenes, twelve digits of their SHA-256.
    """

    commit: str
    digest: str

    def said(self) -> str:
        """In words."""
        return f"{f'commit {self.commit}' if self.commit else 'commit not known'}, files {self.digest}"


def code_here(scenes: Iterable[Path]) -> Code:
    """That which runs.

    Args:
        scenes: Files of the scenes that are read.
    """
    package = Path(otwarp.__file__).resolve().parent
    return Code(commit=commit_of(package.parent, package.name, "scenes"), digest=_digest(package, scenes))


def _digest(package: Path, scenes: Iterable[Path]) -> str:
    """Of files by their names below the package, and of scenes by theirs alone."""
    files = {file.relative_to(package).as_posix(): file for file in package.rglob("*") if file.suffix in ENDINGS}
    files |= {f"scenes/{file.name}": file for file in scenes}
    whole = hashlib.sha256()
    for name, file in sorted(files.items()):
        whole.update(f"{name} {hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
    return whole.hexdigest()[:12]
