"""The commit of the code that runs, for whatever states what it found."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path


def commit_of(root: Path, *folders: str) -> str:
    """Short hash of a checkout's commit, with a + where files differ from it; empty where nobody knows.

    A copy without its history tells it by the variable `OTWARP_COMMIT`.

    Args:
        root: The checkout, or whatever else the code lies in.
        folders: In it, that matter; the first one belongs to the checkout, else its commit says nothing of the code.
    """
    told = os.environ.get("OTWARP_COMMIT", "")
    if told:
        return told
    try:
        _git(root, "ls-files", "--error-unmatch", "--", folders[0])
        known = _git(root, "rev-parse", "--short=8", "HEAD")
        return known + "+" * bool(_git(root, "status", "--porcelain", "--", *folders))
    except (OSError, subprocess.CalledProcessError):
        return ""


def _git(root: Path, *words: str) -> str:
    """What git says of a checkout."""
    done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True)
    return done.stdout.strip()
