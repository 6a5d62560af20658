"""The site of the documentation: it builds without a warning, fetches nothing, can be searched, and all can read it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.documents import ROOT
from tests.teleop.page.browser import browser

pytest.importorskip("material")
pytest.importorskip("mkdocstrings")

PAGES = (
    "index.html",
    "dynamics.html",
    "scene.html",
    "benchmarks.html",
    "repository/index.html",
    "reference/commands/run.html",
    "reference/python/otwarp.html",
    "notebooks/trap_calibration.html",
    *(f"tutorials/{page.stem}.html" for page in sorted((ROOT / "docs" / "tutorials").glob("*.md"))),
    "start.html",
)
"""One of each kind, and all tutorials."""
SERIOUS = ("serious", "critical")
FETCHED = re.compile(
    r"""<(?:script|link|img|iframe)[^>]+?(?:src|href)=["']?(?:https?:)?//[^"'>]*|@import[^;]*//[^;]*;"""
)
"""What a page fetches from elsewhere."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the site, built with warnings as errors."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    )
    assert done.returncode == 0, done.stderr
    return folder


def test_every_page_is_there_and_nothing_is_fetched(site: Path):
    pages = list(site.rglob("*.html"))
    assert len(pages) > 300
    for page in (*pages, *site.rglob("*.css")):
        found = FETCHED.findall(page.read_text(encoding="utf-8"))
        assert not found, f"{page.relative_to(site)}: {found[:3]}"


def test_a_search_finds_a_page_from_a_disk(site: Path):
    with browser() as chromium:
        window = chromium.new_page()
        asked: list[str] = []
        window.on("request", lambda request: asked.append(request.url))
        window.goto((site / "index.html").as_uri())
        field = window.get_by_role("textbox", name="Search")
        field.click()
        field.press_sequentially("forward flux", delay=50)
        window.locator(".md-search-result__link").first.wait_for(timeout=60_000)
        assert "flux" in window.locator(".md-search-result__list").inner_text().lower()
        assert [url for url in asked if not url.startswith("file:")] == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nobody_is_kept_out(site: Path, scheme: str):
    """No serious violation of what axe-core checks: contrast, names of controls, order of headings, keyboard, …"""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    with browser() as chromium:
        window = chromium.new_page(viewport={"width": 1280, "height": 900}, color_scheme=scheme)
        for name in PAGES:
            window.goto((site / name).as_uri())
            result = axe.run(window).response
            assert result["passes"], name
            bad = [(v["id"], v["nodes"][0]["html"]) for v in result["violations"] if v["impact"] in SERIOUS]
            assert not bad, f"{name}: {bad}"
