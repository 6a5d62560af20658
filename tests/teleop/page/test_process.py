"""The page's process without a browser: how frames go there, and that the session does not care how it fares."""

from __future__ import annotations

import io
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import otwarp as ot
import otwarp.teleop.page as module
from otwarp.errors import InputError
from otwarp.haptics.core.fields import Matrix
from otwarp.teleop import Sink
from otwarp.teleop.page import PageProcess
from otwarp.teleop.page.protocol import Complaint, receive, send
from tests.teleop.page.loop import Loop
from tests.teleop.page.test_browser import SCENE

pytest.importorskip("viser")
BEAD = SCENE.with_name("single_bead.usda")
POLLS, PAUSE = 6000, 0.01
"""How often and how long [s] to look again before something counts as never happening."""


def eventually(true: Callable[[], bool]) -> bool:
    for _ in range(POLLS):
        if true():
            return True
        time.sleep(PAUSE)
    return False


@pytest.fixture(scope="module")
def loop(device: str) -> Loop:
    loop = Loop(ot.Scene.load(BEAD), device=device)
    loop.advance(1e-3)
    return loop


@pytest.fixture
def bead() -> ot.Scene:
    return ot.Scene.load(BEAD)


@pytest.mark.thorough
def test_frames_wait_for_the_one_before_and_the_session_never(loop: Loop, bead: ot.Scene):
    with PageProcess(bead, port=0) as page:
        sink: Sink = page
        assert sink.interval == pytest.approx(1.0 / 30.0) and page.alive and page.visitors == 0
        sink.publish(loop.frame())
        assert eventually(lambda: page._credit)
        page.complain("no such trap")
        pid = page.pid
        assert pid is not None
        os.kill(pid, signal.SIGSTOP)  # a child that hangs
        try:
            for _ in range(20):
                sink.publish(loop.frame())
                assert list(sink.commands()) == []
            assert page.dropped == 19 and not page._credit
        finally:
            os.kill(pid, signal.SIGCONT)
        assert eventually(lambda: page._credit)
        sink.publish(loop.frame())
        assert eventually(lambda: page._credit) and page.dropped == 19
    page.close()
    assert not page.alive


@pytest.mark.thorough
def test_a_page_that_dies_is_told_once_and_the_session_goes_on(loop: Loop, bead: ot.Scene):
    lines: list[str] = []
    page = PageProcess(bead, port=0, ended=lines.append)
    page.start()
    assert page.pid is not None
    os.kill(page.pid, signal.SIGKILL)
    assert eventually(lambda: not page.alive)
    for _ in range(5):
        page.publish(loop.frame())
        page.complain("x")
        assert list(page.commands()) == []
    assert lines == ["page: its process ended with -9; the session goes on without it"]
    page.close()
    page.close()


@pytest.mark.thorough
def test_a_page_that_hangs_is_killed_at_the_end(loop: Loop, bead: ot.Scene, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "STOP_WITHIN", 0.2)
    page = PageProcess(bead, port=0)
    page.start()
    process = page._process
    assert process is not None
    os.kill(process.pid, signal.SIGSTOP)
    page.publish(loop.frame())
    page.close()
    assert process.returncode == -signal.SIGKILL and not page.alive
    assert not any(thread.is_alive() for thread in page._threads)


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for the process in /proc")
def test_the_page_ends_with_its_session(bead: ot.Scene):
    page = PageProcess(bead, port=0)
    page.start()
    process = page._process
    assert process is not None and process.stdin is not None
    process.stdin.close()  # what a session that is killed leaves behind
    assert process.wait(60.0) == 0
    page.close()


def test_the_token_is_in_the_address(bead: ot.Scene):
    with PageProcess(bead, host="0.0.0.0", port=0) as page:
        assert "/?token=" in page.url and len(page.url.split("token=")[1]) >= 24
    with PageProcess(bead, port=0, token="abcdefghijklmnop") as page:
        assert page.url.endswith("/?token=abcdefghijklmnop")


def test_a_port_that_is_taken_is_one_clear_line(bead: ot.Scene):
    with PageProcess(bead, port=0) as first:
        port = int(first.url.rstrip("/").rsplit(":", 1)[1])
        second = PageProcess(bead, port=port)
        with pytest.raises(InputError, match=f"port = {port}: .*must be a free one") as error:
            second.start()
        assert "\n" not in str(error.value) and not second.alive and first.alive


def test_a_host_that_is_not_here_is_one_clear_line(bead: ot.Scene):
    with pytest.raises(InputError, match=r"host = 'no\.such\.host\.invalid'"):
        PageProcess(bead, host="no.such.host.invalid").start()


def test_a_pointer_without_a_mailbox_is_one_clear_line(bead: ot.Scene):
    with pytest.raises(InputError, match="mailbox 'otwarp-none': cannot be attached"):
        PageProcess(bead, port=0, pointers={"left": "otwarp-none"}).start()


SKEW: Matrix = ((1.0, 0.5, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"rate": 0.0}, "rate = 0.0: must be from 1 to 120"),
        ({"pointers": {"middle": "x"}}, "pointers has 'middle': must be one of left, right"),
        ({"axis_maps": {"left": SKEW}}, "hand.axis_map is"),
        ({"token": "short"}, "token = .*must be 16 or more"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_starts(bead: ot.Scene, options: dict[str, object], line: str):
    with pytest.raises(InputError, match=line):
        PageProcess(bead, **options)  # type: ignore[arg-type]


def test_without_viser_the_extra_is_named(bead: ot.Scene, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"install otwarp\[teleop\]"):
        PageProcess(bead)


def test_a_child_that_says_nothing_is_given_up(bead: ot.Scene, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module.sys, "executable", "/bin/false" if sys.platform != "win32" else "false")
    with pytest.raises(InputError, match="page: its process ended"):
        PageProcess(bead).start()


def test_a_message_that_is_cut_short_is_the_end():
    pipe = io.BytesIO()
    send(pipe, Complaint("x"))
    whole = pipe.getvalue()
    assert receive(io.BytesIO(whole)) == Complaint("x")
    for cut in range(len(whole)):
        with pytest.raises(EOFError):
            receive(io.BytesIO(whole[:cut]))
