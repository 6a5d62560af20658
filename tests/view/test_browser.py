"""`otwarp view` as a user has it: the real command in a process of its own, the page in a real browser."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import otwarp as ot
from otwarp.teleop.page.compose import compose
from otwarp.view import RecordedRun
from otwarp.view.measure import hit
from otwarp.view.sight import length_text
from tests.teleop.page.browser import ARTIFACTS, browser, chromium, pixel
from tests.view.runs import RATE, SCENE
from tests.view.sessions import session

pytest.importorskip("viser")

WIDE, SMALL = {"width": 1280, "height": 800}, {"width": 800, "height": 600}
PATIENCE = 120_000
"""Milliseconds after which something that must happen is called missing."""
SERIOUS = ("serious", "critical")
"""Accessibility errors of axe that the page may not have."""


@contextmanager
def page_of(*arguments: str) -> Iterator[str]:
    """Address of the page of a command, which is ended as Ctrl-C ends it."""
    command = [sys.executable, "-m", "otwarp", *arguments, "--no-open", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            said, _, url = process.stdout.readline().partition(" ")
            assert said == "page", "the page did not begin"
            yield url.split()[0] + "?fixedDpr=0.8"
            process.send_signal(signal.SIGINT)
            assert process.wait(30.0) == 0
        finally:
            process.kill()


def opened(browser: Any, url: str, size: dict[str, int]) -> tuple[Any, list[str]]:
    """A window at the page once it draws, and what goes wrong in it."""
    window = browser.new_page(viewport=size)
    errors: list[str] = []
    window.on("pageerror", lambda error: errors.append(str(error)))
    window.goto(url)
    window.locator("canvas[data-engine]").wait_for(timeout=PATIENCE)
    window.locator("#otwarp-scale").wait_for(timeout=PATIENCE)
    return window, errors


def violations(window: Any) -> list[str]:
    """Serious accessibility errors."""
    from axe_playwright_python.sync_playwright import Axe

    return [
        f"{rule['id']}: {node['html'][:120]}"
        for rule in Axe().run(window).response["violations"]
        if rule["impact"] in SERIOUS
        for node in rule["nodes"]
    ]


def accessible(window: Any) -> bool:
    """Whether there is no serious error of accessibility, once the page has named what is new, twice a second."""
    for _ in range(20):
        if violations(window) == []:
            return True
        window.wait_for_timeout(500)
    assert violations(window) == []
    return True


def share(window: Any) -> float:
    """Where the cursor of the plots stands."""
    return float(window.locator('[data-otwarp="cursor"]').get_attribute("data-share"))


def comes(window: Any, wanted: Any) -> None:
    """Wait until something is so."""
    for _ in range(PATIENCE // 100):
        if wanted():
            return
        window.wait_for_timeout(100)
    pytest.fail("it never came")


def test_a_run_is_played_stepped_and_measured(run: Path):
    source = RecordedRun(run)
    drawing, last = compose(source.scene), float(source.time[-1])
    with browser() as engine, page_of("view", str(run)) as url:
        window, errors = opened(engine, url, WIDE)
        assert window.title() == f"otwarp · {run.name}"
        for title in ("Contact force [pN]", "Robot to trap [µm]", "Speed over 100 ms [µm/s]"):
            window.get_by_text(title).wait_for(timeout=PATIENCE)
        for _ in range(3):
            window.keyboard.press("ArrowRight")
        comes(window, lambda: share(window) == pytest.approx(3 / RATE / last, abs=1e-5))
        window.keyboard.press("End")
        comes(window, lambda: share(window) == 1.0)
        line = window.locator(".u-over .otwarp-cursor").first
        comes(window, lambda: line.evaluate("e => e.style.left") == "100%")
        window.keyboard.press("Home")
        comes(window, lambda: share(window) == 0.0)

        field = window.get_by_role("textbox", name="Time [s]")
        field.fill("1.0")
        field.press("Enter")
        comes(window, lambda: share(window) == pytest.approx(1.0 / last, abs=1e-3))
        window.locator("canvas[data-engine]").click(position={"x": 60, "y": 500})  # the field has the keys no longer
        window.keyboard.press("Home")
        comes(window, lambda: share(window) == 0.0)
        measure(window, drawing, source)
        before = window.locator("#otwarp-scale").get_attribute("data-pixels")
        window.keyboard.press("5")
        comes(window, lambda: window.locator("#otwarp-scale").get_attribute("data-pixels") != before)
        window.keyboard.press("Shift+?")
        window.get_by_role("dialog").get_by_text("one moment back, one on").wait_for(timeout=PATIENCE)
        window.keyboard.press("Escape")
        assert window.get_by_role("dialog").count() == 0
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        window.screenshot(path=ARTIFACTS / "view.png")
        assert accessible(window)

        window.keyboard.press("Space")
        window.get_by_role("button", name="Pause").wait_for(timeout=PATIENCE)
        comes(window, lambda: share(window) == 1.0)
        window.get_by_role("button", name="Play", exact=True).wait_for(timeout=PATIENCE)
        assert errors == []
    source.close()


def measure(window: Any, drawing: Any, source: RecordedRun) -> None:
    """Click on the cell and on a robot, and compare with what a ray from the same camera meets."""
    frame, eye = source.frame(0), np.array(drawing.camera.position)
    box = window.locator("canvas[data-engine]").bounding_box()
    window.keyboard.press("m")
    window.get_by_text("click on a place").wait_for(timeout=PATIENCE)
    met = []
    for place in (frame.position[2], frame.position[1] + np.array([0.0, 0.0, 0.2])):
        window.mouse.click(*pixel(drawing.camera, place, box))
        found = hit(drawing, frame, eye, place - eye)
        assert found is not None
        met.append(found)
        window.get_by_text("µm" if len(met) == 2 else "on what is drawn").first.wait_for(timeout=PATIENCE)
    result = window.get_by_text(re.compile(r"Δ = ")).first
    result.wait_for(timeout=PATIENCE)
    said = [float(x) for x in re.findall(r"Δ = \((.*)\)", result.inner_text())[0].split(",")]
    # a click is on a pixel, of which the camera has some tens per µm
    assert said == pytest.approx(met[1] - met[0], abs=0.3)
    assert re.search(length_text(float(np.linalg.norm(said)))[:3].rstrip("."), result.inner_text())
    window.keyboard.press("m")


def test_a_session_is_played_and_a_plot_clicked_on(tmp_path: Path):
    pytest.importorskip("rosbags")
    session(tmp_path / "take.mcap", ot.Scene.load(SCENE))
    with browser() as engine, page_of("view", str(tmp_path / "take.mcap"), "--theme", "light") as url:
        window, errors = opened(engine, url, WIDE)
        assert window.title() == "otwarp · take.mcap"
        plot = window.locator(".u-over").first
        plot.wait_for(timeout=PATIENCE)
        box = plot.bounding_box()
        for wanted in (0.75, 0.25):
            plot.click(position={"x": wanted * box["width"], "y": 40})
            comes(window, lambda wanted=wanted: share(window) == pytest.approx(wanted, abs=0.01))
        window.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 40)
        window.mouse.down()
        window.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 40)
        window.mouse.up()
        comes(window, lambda: share(window) == pytest.approx(0.6, abs=0.01))
        window.get_by_text("Run", exact=True).click()
        window.get_by_text("that of the session's clock").wait_for(timeout=PATIENCE)
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        window.wait_for_timeout(500)
        window.screenshot(path=ARTIFACTS / "view_session.png")
        assert accessible(window) and errors == []


def test_two_runs_are_compared_in_a_small_window(run: Path, other: Path):
    with browser() as engine, page_of("view", str(run), str(other), "--theme", "light") as url:
        window, errors = opened(engine, url, SMALL)
        window.locator("#otwarp-legend").get_by_text(f"translucent: {other.name}").wait_for(timeout=PATIENCE)
        comes(window, lambda: window.locator("canvas[data-engine]").bounding_box()["width"] > 0.5 * SMALL["width"])
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        assert window.locator("html").get_attribute("data-mantine-color-scheme") == "light"
        window.screenshot(path=ARTIFACTS / "view_small.png")
        window.get_by_role("button", name="Expand column").click()  # it was folded
        window.get_by_text("Contact force [pN]").wait_for(timeout=PATIENCE)
        for label in (f"{run.name}: left", f"{other.name}: left"):
            assert window.get_by_text(label).first.count() == 1
        assert accessible(window) and errors == []
        window.set_viewport_size(WIDE)
        window.wait_for_timeout(2000)
        window.set_viewport_size(SMALL)  # folded again, and not for ever
        comes(window, lambda: not window.get_by_text("Contact force [pN]").is_visible())
        window.set_viewport_size(WIDE)
        window.get_by_text("Contact force [pN]").wait_for(timeout=PATIENCE)


def test_a_browser_without_webgl_is_told_so(run: Path):
    path = chromium()
    from playwright.sync_api import sync_playwright

    with page_of("view", str(run)) as url, sync_playwright() as playwright:
        engine = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-3d-apis"])
        window: Any = engine.new_page(viewport={"width": 800, "height": 600})
        window.goto(url)
        words = window.get_by_role("alert").filter(has_text="WebGL 2")
        words.wait_for(timeout=PATIENCE)
        assert "This browser cannot draw the scene" in words.inner_text()
        assert "otwarp preview" in words.inner_text()
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        window.screenshot(path=ARTIFACTS / "no_webgl.png")
        engine.close()
