"""Headless Chromium for tests of the page, and where a place of the scene is on its screen."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from otwarp.teleop.page.protocol import CameraDrawing

ARTIFACTS = Path(__file__).resolve().parents[3] / "out" / "test-artifacts"
SIZE = {"width": 1280, "height": 720}


def chromium() -> str:
    """Path of the browser; skips the test without one, or fails where it was promised."""
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    try:
        import playwright  # noqa: F401
    except ImportError:
        path = None
    if path is None:
        reason = "needs playwright from PyPI and chromium from the system"
        if os.environ.get("OTWARP_REQUIRE_CHROMIUM") == "1":
            pytest.fail(reason)
        pytest.skip(reason)
    return path


@contextmanager
def browser() -> Iterator[Any]:
    """A browser that draws WebGL without a graphics card."""
    path = chromium()
    from playwright.sync_api import sync_playwright

    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=flags)
        try:
            yield browser
        finally:
            browser.close()


def pixel(camera: CameraDrawing, place: Any, box: dict[str, float]) -> tuple[float, float]:
    """Where a place [µm] is on the page whose canvas has this bounding box, seen from where the page first looks."""
    eye = np.array(camera.position)
    forward = np.array(camera.look_at) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    way = np.asarray(place, dtype=float) - eye
    unit = box["height"] / (2.0 * np.tan(0.5 * camera.fov)) / float(way @ forward)
    middle = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    return middle[0] + unit * float(way @ right), middle[1] - unit * float(way @ up)
