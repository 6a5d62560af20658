"""MP4 and WebM: the frames that went in come out again, and a movie that fails leaves nothing."""

from __future__ import annotations

import importlib.util
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.preview import video
from otwarp.preview.draw import preview
from tests.preview import stages

imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")

LOSS = 12.0
"""Mean difference in levels of 255: both codecs lose a little, most at edges of colours."""


def read_back(file: Path) -> tuple[str, np.ndarray]:
    """What ffmpeg says of a file, and its frames (n, h, w, 3)."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(file), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(command, capture_output=True, timeout=60, check=True)
    about = next(row for row in done.stderr.decode().splitlines() if "Video:" in row)
    width, height = map(int, re.search(r" (\d+)x(\d+)[, ]", about).groups())
    return about, np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3).astype(float)


def moving_square(count: int, height: int, width: int) -> list[np.ndarray]:
    frames = [np.full((height, width, 3), 20, dtype=np.uint8) for _ in range(count)]
    for k, frame in enumerate(frames):
        frame[10:30, 4 * k : 4 * k + 20] = (250, 120, 10)
    return frames


@pytest.mark.parametrize("ending, codec", [("mp4", "h264"), ("webm", "vp9")])
def test_frames_times_and_colours_are_read_back(tmp_path: Path, ending: str, codec: str):
    wanted = moving_square(9, 61, 97)  # odd: the last row and column go
    file = tmp_path / f"a.{ending}"
    assert video.save_video(iter(wanted), file, 12.0) == 9
    about, found = read_back(file)
    assert f"Video: {codec}" in about
    assert "bt709" in about
    assert "12 fps" in about
    assert found.shape == (9, 60, 96, 3)
    for k, (frame, shown) in enumerate(zip(wanted, found, strict=True)):
        assert np.abs(frame[:60, :96] - shown).mean() < LOSS
        assert np.abs(shown[15:25, 4 * k + 5 : 4 * k + 15].mean(axis=(0, 1)) - (250, 120, 10)).max() < LOSS
    assert [entry.name for entry in tmp_path.iterdir()] == [file.name]


def test_a_movie_that_fails_leaves_no_file(tmp_path: Path):
    def broken():
        yield from moving_square(2, 60, 96)
        raise RuntimeError("out of light")

    with pytest.raises(RuntimeError, match="out of light"):
        video.save_video(broken(), tmp_path / "a.mp4", 10)
    with pytest.raises(InputError, match="no frames"):
        video.save_video([], tmp_path / "a.webm", 10)
    with pytest.raises(InputError, match="frame 1 has shape"):
        video.save_video([*moving_square(1, 60, 96), *moving_square(1, 60, 98)], tmp_path / "a.mp4", 10)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ["mp4", "webm"])
# where ffmpeg has gone by itself, imageio-ffmpeg leaves its own end of the pipe to the collector
@pytest.mark.filterwarnings("ignore:Exception ignored in. <_io.FileIO:pytest.PytestUnraisableExceptionWarning")
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_movie_on_a_full_disk_is_refused(tmp_path: Path, ending: str):
    noise = np.random.default_rng(1).integers(0, 255, (60, 64, 96, 3), dtype=np.uint8)
    for frames in (noise[:2], noise):  # it fails at the end, or on the way
        (tmp_path / f".a.part.{ending}").symlink_to("/dev/full")
        with pytest.raises(InputError, match=r"ffmpeg wrote \d+ of \d+ frames; allowed: a disk with room"):
            video.save_video(frames, tmp_path / f"a.{ending}", 10)
        assert list(tmp_path.iterdir()) == []


def test_a_run_is_filmed(tmp_path: Path):
    run = stages.recorded_run(tmp_path / "run")
    assert preview(run, movie=tmp_path / "run.mp4", size=(96, 54), samples=1, device="cpu", fps=10) == [
        tmp_path / "run.mp4"
    ]
    _, frames = read_back(tmp_path / "run.mp4")
    assert len(frames) == 7
    assert np.abs(frames[-1] - frames[0]).max() > 60


def test_without_ffmpeg_the_words_say_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        InputError, match=r"needs imageio-ffmpeg: pip install 'otwarp\[movie\]'; allowed without: \.gif"
    ):
        video.check_video(tmp_path / "run.mp4")
    video.check_video(tmp_path / "run.gif")
