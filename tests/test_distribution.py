"""What stands beside the package says what pyproject.toml says."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import otwarp

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
NAMES = {"matplotlib": "matplotlib-base"}
"""Of packages that conda-forge calls otherwise."""


def test_the_conda_recipe_asks_for_the_same() -> None:
    text = (ROOT / "conda" / "meta.yaml").read_text(encoding="utf-8")
    run = text.split("  run:\n")[1].split("test:")[0]
    asked = set(re.findall(r"- (\S+) >=(\S+)", run))
    wanted = {tuple(d.lower().split(">=")) for d in PROJECT["project"]["dependencies"]}
    assert asked == {(NAMES.get(n, n), v) for n, v in wanted} | {
        ("python", PROJECT["project"]["requires-python"].removeprefix(">="))
    }
    assert f"otwarp = {PROJECT['project']['scripts']['otwarp']}" in text


def test_the_fallback_version_is_said_everywhere() -> None:
    fallback = PROJECT["tool"]["setuptools_scm"]["fallback_version"]
    assert f'"{fallback}"' in (ROOT / "conda" / "meta.yaml").read_text(encoding="utf-8")
    assert f"none of them tells, {fallback}." in (ROOT / "docs" / "install.md").read_text(encoding="utf-8")


def test_the_version_is_that_of_an_installed_package() -> None:
    assert re.match(r"\d+[.+]", otwarp.__version__)
    assert "export-subst" in (ROOT / ".gitattributes").read_text(encoding="utf-8")


def test_issues_ask_for_what_helps() -> None:
    for name in ("bug", "wish"):
        text = (ROOT / ".github" / "ISSUE_TEMPLATE" / f"{name}.yml").read_text(encoding="utf-8")
        assert text.startswith("name: ") and text.count("label: ") >= 2
