from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

from otwarp.haptics.core import ServoFrame
from otwarp.haptics.servo.link import HandStatus, ServoStatus
from otwarp.teleop import HandFrame, PaceNow
from otwarp.teleop.page.controls import HOLD, Follower, file_name
from otwarp.teleop.page.readout import LONGEST_DEVICE, QUIET, News, banner, figures, hand_text
from tests.teleop.page.frames import page_frame

EVIL = '<img src=x onerror="alert(1)">'


def hand(**more: object) -> HandFrame:
    given = {"name": "left", "device": "haply", "traps": (), "motion_gain": 200.0, "force_gain": 0.1, "clamp": 3.0}
    return HandFrame(**(given | more))  # type: ignore[arg-type]


def test_nothing_that_is_told_becomes_markup():
    told = hand(device=EVIL, message=EVIL, now=ServoFrame(1, 0.0, (0, 0, 0), (0, 0, 0), (), "armed", 0.0))
    servo = ServoStatus(1, 0.0, "running", 3, 2e-5, 1, 0, (HandStatus(),), EVIL)
    texts = banner([EVIL] * 9, PaceNow(), f"/tmp/{EVIL}") + hand_text(told)
    texts += figures(page_frame(servo=servo, warnings=(EVIL,)), 30.0, 0.01, 1)
    assert "<img" not in texts and "&lt;img" in texts and "and 3 more" in texts


def test_the_banner_says_what_is_wrong_and_what_goes_on():
    quiet = banner((), PaceNow(), None)
    assert "running at 1.00" in quiet and "recording" not in quiet and "⚠" not in quiet
    loud = banner(("robot lost",), PaceNow(paused=True), "/a/b/take1.mcap")
    task = banner((), PaceNow(), None, f"cell is 3.2 µm from the goal {EVIL}")
    assert "cell is 3.2 µm from the goal &lt;img" in task and "<img" not in task
    assert "paused" in loud and "recording take1.mcap" in loud and "⚠ robot lost" in loud


def test_the_figures_say_how_all_keep_up():
    servo = ServoStatus(1, 0.0, "running", 3, 2e-5, 0, 0, (HandStatus(),))
    frame = page_frame(time=1.5, servo=servo, pace=PaceNow(speed=1.0, factor=0.4, slipped=0.9, busy=0.98, rate=120.0))
    text = figures(frame, 29.7, 0.0121, 2)
    for part in ("1.50 s", "0.40</span> of 1.00", "0.90 s", "98 % busy", "30 frames/s, 2 windows", "≤ 12 ms"):
        assert part in text
    assert "3 late cycles" in text and "20 µs worst" in text and "states refused" not in text
    assert "–" in figures(frame, 0.0, None, 0) and "force law" not in text
    assert "in Python: no room &lt;img" in figures(page_frame(engine=f"in Python: no room {EVIL}"), 30.0, None, 1)


def test_a_hand_says_its_state():
    absent = hand_text(hand(message="unplugged at 3.2 s"))
    assert "absent" in absent and "unplugged at 3.2 s" in absent and "no word yet" in absent
    now = ServoFrame(1, 0.0, (0, 0, 0), (0.3, 0.4, 0), (), "armed", 0.0)
    assert "0.50 N of 3.00 N" in hand_text(hand(now=now, present=True))


def test_a_long_name_of_a_device_fits_its_row_and_is_shown_whole_by_the_pointer():
    name = "replay:/a/folder/that/lies/very/far/down/take1.mcap,hand=left"
    text = hand_text(hand(device=name, present=True))
    shown = re.sub(r"<[^>]*>", "", text)
    assert "replay:/a" in shown and "hand=left" in shown and "…" in shown and name not in shown
    assert len(re.search(r"device(.*?)state", shown)[1]) == LONGEST_DEVICE  # type: ignore[index]
    assert f'title="{name}"' in text
    assert "<img" not in hand_text(hand(device=EVIL * 3))


def test_a_warning_is_news_once_whatever_its_numbers():
    news = News()
    assert news.of(["load 12.3 pN above 10 pN", "trap 1 lost"], 0.0) == ["load 12.3 pN above 10 pN", "trap 1 lost"]
    for k in range(1, 100):  # there all the time: said once
        assert news.of([f"load {12.3 + 0.1 * k:.1f} pN above 10 pN"], 0.1 * k) == []
    assert news.of(["load 1e-3 pN above 10 pN"], 9.9 + 1.1 * QUIET) != []


@dataclass
class Slider:
    value: float = 1.0
    min: float = 0.0
    max: float = 10.0
    step: float = 0.1


def test_a_slider_follows_frames_but_not_against_its_user():
    slider = Slider()
    follower = Follower(slider)
    follower.follow(3.0, 0.0)
    assert slider.value == 3.0
    follower.touched(10.0)
    follower.follow(5.0, 10.0 + 0.9 * HOLD)
    assert slider.value == 3.0
    follower.follow(5.0, 10.0 + HOLD)
    assert slider.value == 5.0
    follower.follow(5.04, 20.0)  # less than half a step: no message
    assert slider.value == 5.0
    follower.follow(99.0, 21.0)
    assert slider.value == 10.0
    for odd in (float("nan"), float("-inf")):
        follower.follow(odd, 22.0)
    assert slider.value in (0.0, 10.0)


@pytest.mark.parametrize(
    ("text", "name"),
    [("", None), ("  ", None), ("take 1.mcap", "take 1.mcap"), (" a-b_c ", "a-b_c.mcap"), ("A.MCAP", "A.MCAP")],
)
def test_a_recording_has_a_plain_name(text: str, name: str | None):
    assert file_name(text) == name


@pytest.mark.parametrize("text", ["../x", "/etc/passwd", "a/b", "a\\b", ".hidden", "a\nb", "c:x", "~x", "x\0y"])
def test_a_recording_stays_in_its_folder(text: str):
    with pytest.raises(ValueError, match="must be a plain name"):
        file_name(text)
