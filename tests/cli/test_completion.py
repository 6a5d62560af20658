"""Completion in shells, as `otwarp --help` describes it."""

from __future__ import annotations

import subprocess
import sys

import pytest


def otwarp(**variables: str) -> str:
    """What the command prints to a shell that asks by variables."""
    command = [sys.executable, "-c", "import sys; from otwarp.cli.main import main; sys.exit(main())"]
    return subprocess.run(command, env=variables, capture_output=True, text=True, check=False).stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_script_for_the_shell(shell: str) -> None:
    if shell == "bash":
        pytest.importorskip("click.shell_completion")
    script = otwarp(_OTWARP_COMPLETE=f"{shell}_source", PATH="/usr/bin:/bin")
    assert "_OTWARP_COMPLETE=" in script and f"{shell}_complete" in script


@pytest.mark.parametrize(
    ("words", "at", "expected"),
    [
        ("otwarp val", "1", ["plain,validate"]),
        ("otwarp run --prec", "2", ["plain,--precision"]),
        ("otwarp run --precision f", "3", ["plain,float32", "plain,float64"]),
        ("otwarp bench sta", "2", ["plain,stability"]),
        ("otwarp run sce", "2", ["file,sce"]),
        ("otwarp run --out o", "3", ["dir,o"]),
        ("otwarp preview --movie m", "3", ["file,m"]),
    ],
)
def test_commands_options_and_files_complete(words: str, at: str, expected: list[str]) -> None:
    found = otwarp(_OTWARP_COMPLETE="bash_complete", COMP_WORDS=words, COMP_CWORD=at)
    assert found.split() == expected
