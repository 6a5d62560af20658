"""How long a state takes to the page: a page of its own, frames at its rate, and a browser without a window, if any."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from statistics import median

import numpy as np

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Scene, Sphere, Track, Trap
from otwarp.simulation.frame import Frame
from otwarp.teleop import LiveFrame
from otwarp.teleop.page import PageProcess

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")
LOAD_WITHIN = 30.0
"""Seconds that a browser has to load the page and to answer for the first time."""

END_WITHIN = 5.0
"""Seconds that it has to end once it is asked to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageLatency:
    """What was measured.

    Attributes:
        frames: Frames that were shown.
        applied: Median and largest time from `publish` until the page's process had handed a frame on [s].
        browser: Which one answered, or why none did.
        answers: How many answers it gave.
        delay: Median and largest time from `publish` to its answer [s], the way back included; None without answers.
    """

    frames: int
    applied: tuple[float, float]
    browser: str
    answers: int
    delay: tuple[float, float] | None


def measure_page(seconds: float = 5.0, *, browser: str | None = None) -> PageLatency:
    """Show a bead that moves.

    Args:
        seconds: Length of the measurement, after a browser has answered [s].
        browser: Its program; None looks for a Chromium.

    Raises:
        InputError: The page cannot be served, or there is no such browser.
    """
    if browser is not None and shutil.which(browser) is None:
        raise InputError(f"--browser is {browser!r}; allowed: a program that is there")
    program = browser or next((path for name in BROWSERS if (path := shutil.which(name))), None)
    with PageProcess(_scene(), port=0) as page, tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        window = _window(program, page.url, profile) if program else None
        try:
            applied, answers = _watch(page, seconds, LOAD_WITHIN if window else 0.0)
        finally:
            if window is not None:
                _end(window)
    said = program or f"none found ({', '.join(BROWSERS)}); the page shows the figure to a browser that is open"
    return PageLatency(
        frames=len(applied),
        applied=(median(applied), max(applied)) if applied else (0.0, 0.0),
        browser=f"{said}: did not answer" if program and not answers else said,
        answers=len(answers),
        delay=(median(answers), max(answers)) if answers else None,
    )


def _watch(page: PageProcess, seconds: float, patience: float) -> tuple[list[float], list[float]]:
    """Times until frames were handed on, and of a browser's answers [s]."""
    applied: list[float] = []
    answers: list[float] = []
    beat, begun = 0, time.monotonic()
    end = begun + (patience or seconds)
    while time.monotonic() < end:
        if page.ready:
            if beat:
                applied.append(page.applied)
            if page.delay is not None and (not answers or page.delay != answers[-1]):
                if not answers:  # the first one has loaded the page
                    end = time.monotonic() + seconds
                answers.append(page.delay)
            beat += 1
            page.publish(_frame(beat))
        time.sleep(page.interval)
    return applied, answers


def _window(program: str, url: str, profile: str) -> subprocess.Popen[bytes]:
    """A browser without a window, at the page."""
    options = ["--headless=new", f"--user-data-dir={profile}", "--no-first-run", "--enable-unsafe-swiftshader"]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        options.append("--no-sandbox")  # Chromium refuses to run as root with it; the page is our own
    return subprocess.Popen([program, *options, url], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _end(window: subprocess.Popen[bytes]) -> None:
    window.terminate()
    try:
        window.wait(END_WITHIN)
    except subprocess.TimeoutExpired:
        window.kill()
        window.wait()


def _scene() -> Scene:
    sphere = Sphere(prim="/World/bead/sphere", radius=1.0)
    trap = Trap(
        prim="/World/trap",
        position=Track.constant((0.0, 0.0, 5.0)),
        power=Track.constant(5.0),
        model="harmonic",
        radial=TrapLaw(stiffness=1.0),
    )
    return Scene(bodies=(Body(prim="/World/bead", position=(0.0, 0.0, 5.0), spheres=(sphere,)),), traps=(trap,))


def _frame(beat: int) -> LiveFrame:
    """A bead on a circle."""
    place = np.array([[[np.cos(0.1 * beat), np.sin(0.1 * beat), 5.0]]])
    none, one = np.zeros((1, 1)), np.ones((1, 1))
    frame = Frame(
        step=beat,
        time=beat / 30.0,
        position=place,
        orientation=np.array([[[0.0, 0.0, 0.0, 1.0]]]),
        trap_position=place,
        trap_power=5.0 * one,
        trap_force=np.zeros((1, 1, 3)),
        trap_distance=none,
        escape_time=np.full((1, 1), np.nan),
        contact_force=np.zeros((1, 1, 3)),
        contact_load=none,
    )
    return LiveFrame(beat=beat, wall=beat / 30.0, frame=frame, hand_force=np.zeros((2, 3)))
