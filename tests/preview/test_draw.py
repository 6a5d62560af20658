"""Scale bar, files, movies and the one call behind `otwarp preview`."""

from __future__ import annotations

import inspect
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from otwarp.errors import InputError, PlausibilityWarning
from otwarp.preview.annotate import _font, annotate, length_text, scale_bar
from otwarp.preview.draw import preview
from otwarp.preview.image import save_movie, save_png
from otwarp.preview.studio import nice_length
from otwarp.scene.drawing.drawables import read_drawables
from tests.preview import stages

SMALL = {"size": (96, 54), "samples": 1, "device": "cpu"}


@pytest.fixture
def run(tmp_path):
    """Folder of a run of 7 frames at 10 per second, from time code 3: a ball that moves 1 µm per frame."""
    return stages.recorded_run(tmp_path / "run")


def bar_pixels(image, blank):
    rows, columns = np.nonzero((image != blank).any(axis=2))
    lowest = columns[rows == rows.max()]
    return lowest.max() - lowest.min() + 1


@pytest.mark.parametrize("width", [300, 801, 1280])
def test_the_scale_bar_is_as_long_as_it_says_under_an_orthographic_camera(width):
    stage = stages.new_stage()
    stages.camera(stage, eye=(0, 0, 60), width=400.0, height=225.0, ortho=True)
    view = read_drawables(stage).view
    height = round(width * 9 / 16)
    pixel_size = view.pixel_size(width, height)
    length, _ = scale_bar(width, pixel_size)
    blank = np.zeros((height, width, 3), dtype=np.uint8)
    drawn = bar_pixels(annotate(blank, pixel_size=pixel_size), blank)
    assert drawn * pixel_size == pytest.approx(length, abs=pixel_size)
    assert length == 5.0


def test_the_scale_bar_holds_at_the_focus_distance_of_a_perspective_camera():
    stage = stages.new_stage()
    stages.camera(stage, eye=(0, 0, 50), width=40.0, height=20.0, focal=20.0)
    # At 50 µm the window is 50·40/20 = 100 µm wide.
    assert read_drawables(stage).view.pixel_size(200, 100) == pytest.approx(0.5)
    # A squarer picture keeps the width of the window, a wider one its height.
    assert read_drawables(stage).view.pixel_size(200, 200) == pytest.approx(0.5)
    assert read_drawables(stage).view.pixel_size(400, 100) == pytest.approx(0.5)


def test_round_lengths():
    assert [nice_length(x) for x in (0.99, 1.0, 4.9, 5.0, 37.0)] == pytest.approx([0.5, 1.0, 2.0, 5.0, 20.0])
    assert [length_text(x) for x in (0.2, 5.0, 2000.0)] == ["200 nm", "5 µm", "2 mm"]


def test_the_font_has_a_micro_sign():
    shapes = [bytes(_font(40).getmask(letter)) for letter in ("µ", "\uffff")]
    assert shapes[0] != shapes[1]


def test_annotation_leaves_the_input_alone_and_writes_time_and_title():
    blank = np.full((200, 300, 3), 250, dtype=np.uint8)
    noted = annotate(blank, pixel_size=0.1, time=1.25, title="cells")
    assert np.all(blank == 250)
    for part in (noted[:60, :150], noted[150:, :150], noted[150:, 150:]):
        assert np.any(part < 100)


def test_png_is_complete_or_absent(tmp_path):
    image = np.random.default_rng(1).integers(0, 255, (20, 30, 3), dtype=np.uint8)
    path = save_png(image, tmp_path / "a.png")
    assert np.array_equal(np.asarray(Image.open(path)), image)
    with pytest.raises(InputError, match=r"cannot be written"):
        save_png(image, tmp_path / "none" / "a.png")
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.png"]


def test_movie_has_its_frames_duration_and_pictures(tmp_path):
    frames = [np.full((40, 60, 3), 20, dtype=np.uint8) for _ in range(9)]
    for k, frame in enumerate(frames):
        frame[10:20, 4 * k : 4 * k + 10] = (250, 120, 10)
    assert save_movie(iter(frames), tmp_path / "a.gif", 12.0) == 9
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == 9
        total = 0
        for k, frame in enumerate(frames):
            film.seek(k)
            total += film.info["duration"]
            assert np.abs(np.asarray(film.convert("RGB"), dtype=int) - frame).max() <= 8
        assert film.info["loop"] == 0
    assert total == 750  # 9 frames at 12 per second


def test_a_movie_that_fails_leaves_no_file(tmp_path):
    def broken():
        yield np.zeros((8, 8, 3), dtype=np.uint8)
        raise RuntimeError("out of light")

    with pytest.raises(RuntimeError, match="out of light"):
        save_movie(broken(), tmp_path / "a.gif", 10)
    with pytest.raises(InputError, match="no frames"):
        save_movie([], tmp_path / "a.gif", 10)
    with pytest.raises(InputError, match=r"fps = 0, allowed \(0, 50\]"):
        save_movie([], tmp_path / "a.gif", 0)
    assert list(tmp_path.iterdir()) == []


def ball_column(path):
    image = np.asarray(Image.open(path), dtype=int)[4:38]
    return np.nonzero(image.max(axis=2) > 110)[1].mean()


def test_preview_draws_the_frame_asked_for(run, tmp_path):
    for name, options in (("first", {}), ("frame", {"frame": 6}), ("time", {"time": 0.6})):
        assert preview(run, tmp_path / f"{name}.png", **options, **SMALL) == [tmp_path / f"{name}.png"]
    # 32 µm over 96 pixels: 6 µm are 18 pixels.
    moved = ball_column(tmp_path / "frame.png") - ball_column(tmp_path / "first.png")
    assert moved == pytest.approx(18.0, abs=1.0)
    assert (tmp_path / "frame.png").read_bytes() == (tmp_path / "time.png").read_bytes()


def test_preview_films_a_run(run, tmp_path):
    preview(run, movie=tmp_path / "run.gif", fps=10, **SMALL)
    with Image.open(tmp_path / "run.gif") as film:
        assert film.n_frames == 7
    calls = []
    preview(run, movie=tmp_path / "lapse.gif", most_frames=4, progress=lambda *done: calls.append(done), **SMALL)
    with Image.open(tmp_path / "lapse.gif") as film:
        assert film.n_frames == 4
    assert calls == [(0, 4), (1, 4), (2, 4), (3, 4), (4, 4)]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"frame": 7}, "frame = 7, allowed [0, 6]"),
        ({"frame": -1}, "frame = -1, allowed [0, 6]"),
        ({"time": 0.7}, "time = 0.7 s, allowed [0, 0.6]"),
        ({"time": float("nan")}, "time = nan s, allowed [0, 0.6]"),
        ({"frame": 1, "time": 0.1}, "only one"),
        ({"camera": "Top"}, "cameras: /World/Camera"),
        ({"size": (0, 10)}, "width = 0, allowed [1, 16384]"),
    ],
)
def test_bad_input_is_named_and_nothing_is_written(run, tmp_path, options, words):
    with pytest.raises(InputError) as caught:
        preview(run, tmp_path / "a.png", **{**SMALL, **options})
    assert words in str(caught.value) and "\n" not in str(caught.value)
    assert not (tmp_path / "a.png").exists()


def test_bad_paths(run, tmp_path):
    with pytest.raises(InputError, match=r"no run\.usda"):
        preview(tmp_path, tmp_path / "a.png", **SMALL)
    with pytest.raises(InputError, match=r"none\.usda: there is no such file"):
        preview(tmp_path / "none.usda", tmp_path / "a.png", **SMALL)
    with pytest.raises(InputError, match="cannot be written"):
        preview(run, tmp_path / "none" / "a.png", **SMALL)
    with pytest.raises(InputError, match="neither"):
        preview(run)


def test_arrows_that_were_not_recorded_are_said(run, tmp_path):
    with pytest.warns(PlausibilityWarning, match=r"no arrows recorded.*--forces"):
        preview(run, tmp_path / "a.png", forces=True, **SMALL)


@pytest.mark.parametrize(("out", "movie"), [("p.jpg", None), ("p", None), (None, "p.avi"), ("p.png", "p.png")])
def test_a_file_whose_name_says_another_format_is_refused(run, tmp_path, out, movie):
    files = [None if name is None else tmp_path / name for name in (out, movie)]
    with pytest.raises(InputError, match=r"p.*: suffix = .*, allowed \.(png|gif, \.mp4, \.webm)$"):
        preview(run, files[0], movie=files[1], **SMALL)
    assert [p.name for p in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize("moment", [{"frame": 2}, {"time": 0.1}])
def test_a_movie_of_one_moment_is_refused(run, tmp_path, moment):
    with pytest.raises(InputError, match=r"preview: (frame = 2|time = 0\.1 s) with a movie"):
        preview(run, movie=tmp_path / "a.gif", **moment, **SMALL)
    assert not (tmp_path / "a.gif").exists()


def test_a_still_stage_has_no_movie(tmp_path):
    stage = stages.new_stage(tmp_path / "still.usda")
    stage.Save()
    with pytest.raises(InputError, match=r"a movie of 1 frames, allowed \[2, inf\)"):
        preview(tmp_path / "still.usda", movie=tmp_path / "a.gif", **SMALL)
    assert not (tmp_path / "a.gif").exists()


@pytest.mark.thorough
def test_a_picture_is_drawn_without_a_word(run, tmp_path):
    code = f"from otwarp.preview.draw import preview; preview({str(run)!r}, {str(tmp_path / 'a.png')!r}, size=(32, 18))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


def test_the_help_says_how_long_a_movie_may_take() -> None:
    from click.testing import CliRunner

    from otwarp.cli.preview import preview as command

    text = " ".join(CliRunner().invoke(command, ["--help"]).stdout.split())
    most = inspect.signature(preview).parameters["most_frames"].default
    assert f"at most {most} pictures, of 0.3 to 1.4 s each" in text
