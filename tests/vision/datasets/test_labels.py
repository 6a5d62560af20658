"""What is known of every image before one is rendered: poses, draws, splits; and what is refused before it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.vision.datasets import Labels, labels_of, load_spec
from tests.vision.datasets.small import TEXT, written


def labels(tmp_path: Path, text: str = TEXT) -> Labels:
    return labels_of(load_spec(written(tmp_path, text)))


def test_rows_go_by_pose_and_depth(tmp_path: Path) -> None:
    found = labels(tmp_path)
    a = found.arrays
    assert found.first.tolist() == [0, 12, 18, 30, 36, 48] and found.chunk == 6
    assert a["tilt"][found.first[:-1]].tolist() == [0, 20, 40, 65, 90]
    assert a["tilt_class"][found.first[:-1]].tolist() == [0, -1, 1, -1, 2]
    assert np.allclose(a["depth"][:12], np.linspace(-2, 2, 12)) and np.all(a["yaw"] == 0)
    assert np.allclose(a["depth_normalized"][12:18], np.linspace(0, 1, 6))
    assert np.all(np.abs(a["x"]) <= 0.2) and a["x"].std() > 0.05 and np.all(a["y"] == 0)


def test_draws_of_one_thing_do_not_depend_on_others(tmp_path: Path) -> None:
    one = labels(tmp_path).arrays
    more = labels(tmp_path, TEXT.replace("[domain]", "[domain]\nwavelength = { values = [0.55, 0.56] }")).arrays
    assert np.array_equal(one["x"], more["x"]) and np.array_equal(one["split_random"], more["split_random"])
    assert set(more["wavelength"]) == {0.55, 0.56}
    assert all(len(set(more["wavelength"][more["pose"] == p])) == 1 for p in range(5))


def test_robots_of_the_class_are_their_own(tmp_path: Path) -> None:
    text = TEXT.replace("seed = 3", "seed = 3\nrobots = 4")
    text = text.replace("[domain]", "[domain]\nradius_scale = { from = 0.9, to = 1.1 }")
    found = labels(tmp_path, text.replace("unseen_tilts = true", "unseen_robots = true"))
    a = found.arrays
    assert found.poses == 20 and len(set(a["radius_scale"])) == 4
    for part in range(3):
        mine = set(a["robot"][a["split_unseen_robots"] == part])
        assert mine and not mine & set(a["robot"][a["split_unseen_robots"] != part])
    first = int(found.first[7])
    assert found.specimen(7).radius.max() == pytest.approx(0.6 * a["radius_scale"][first])


def test_blocks_of_focus_do_not_leak(tmp_path: Path) -> None:
    text = TEXT.replace("count = 12", "count = 120").replace("between_count = 6", "between_count = 60")
    a = labels(tmp_path, text).arrays
    part, depth, of_class = a["split_focus_blocks"], a["depth"], a["tilt_class"] >= 0
    step = 4 / 119
    for n in range(3):
        others = of_class & (part >= 0) & (part != n)
        mine = depth[of_class & (part == n)]
        assert len(mine) and np.abs(mine[:, None] - depth[others][None, :]).min() > 1.5 * step
    assert np.all(part[~of_class] == -1)


def test_unseen_tilts_are_those_between_or_whole_classes(tmp_path: Path) -> None:
    a = labels(tmp_path).arrays
    assert np.array_equal(a["split_unseen_tilts"] == 2, a["tilt_class"] < 0)
    a = labels(tmp_path, TEXT.replace("between = 1", "").replace("between_count = 6", "")).arrays
    assert np.array_equal(a["split_unseen_tilts"] == 2, a["tilt_class"] == 1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "numerical_aperture = 1.0",
            "numerical_aperture = 1.6",
            "numerical_aperture of the microscope is 1.6; allowed: ",
        ),
        (
            "numerical_aperture = 1.0",
            "numerical_aperture = 0",
            "numerical_aperture of the microscope is 0; allowed: above 0, up to 1.518",
        ),
        ("[optics]", "[optics]\nmedium_index = 0", "medium_index of the microscope is 0; allowed: above 0, up to 4"),
        ("[domain]", "[domain]\nnumerical_aperture = 0", "domain, numerical_aperture, is 0; allowed: 0.01 to 1.7"),
        ("margin = 1", "margin = 1\nspacing = 0", "render, spacing, is 0; allowed: 0.001 to 1000"),
        ("thickness = 0.2", "thickness = 0", "render, thickness, is 0; allowed: 0.001 to 1000"),
        ("[-0.8, 0, 0]", "[1e100, 0, 0]", r"sphere 1, center, is 1e\+100; allowed: -1000 to 1000"),
        ("[-0.8, 0, 0]", f"[1{400 * '0'}, 0, 0]", "sphere 1, center, is 10*; allowed: a finite number"),
        ("poses = 1", "axis = [1e300, 0, 0]", r"axis is 1e\+300; allowed: -1e\+06 to 1e\+06"),
        ("count = 12", 'count = 12\nscattered = "no"', "depth, scattered, is 'no'; allowed: true or false"),
        ("count = 12", "count = 12\nscattered = 1", "depth, scattered, is 1; allowed: true or false"),
        ("between_count = 6", "between_count = 0", "between_count, is 0; allowed: a whole number, 1 to 100000"),
        ("pixel = 0.13", "pixel = 0.2", "pixel of the microscope is 0.2; allowed: above 0, up to 0.1375, λ"),
        ("width = 32", "width = 16", "reaches 1.[0-9]+ µm from the middle along x; allowed: up to 1.04 µm, the frame"),
        (
            "margin = 1",
            "margin = 1\nvolume = 2",
            "the robot at tilt 65° is 2.36 µm thick; allowed: up to 2 µm, the volume",
        ),
        ("[6, 3, 3]", "[12, 0, 0]", "splits, random, leaves nothing for validation"),
        ("[6, 3, 3]", "[12, 3, 3]", "of together at most 12 images"),
        ("unseen_tilts", "unseen_robots", "has 1 robots; allowed: 3 or more"),
        ("blocks = 4", "blocks = 2", "blocks, is 2; allowed: a whole number, 3 to 10000"),
        ("x = {", "z = {", "domain has z; allowed: "),
        ("from = -0.2", "from = 0.4", "domain, x, goes from 0.4 to 0.2"),
        ("brightness = { from = 0.3", "brightness = { from = 0", "brightness of the sensor is|allowed: above 0"),
        ("radius = 0.6", "radius = -0.6", "sphere 1, radius, is -0.6; allowed: "),
        ("classes = [0, 40, 90]", "classes = [0, 0]", "increasing degrees"),
        ("seed = 3", "seed = -3", "seed is -3; allowed: "),
        ("poses = 1", "pose = 1", "the file has pose; allowed: "),
        ("poses = 1", 'scene = "x.usda"', "scene and sphere"),
        ("[image]", "[image", "cannot be read: "),
    ],
)
def test_nonsense_is_refused_before_anything_is_rendered(
    tmp_path: Path, old: str, new: str, message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert old in TEXT
    text = TEXT.replace(old, new)
    if old == "brightness = { from = 0.3":  # the draw itself must be refused, not the ends
        text = text.replace("from = 0, to = 0.4", "values = [0.0]")
    with pytest.raises(InputError, match=message):
        labels(tmp_path, text)
    assert main(["vision", "dataset", str(tmp_path / "small.toml"), "-o", str(tmp_path / "out")]) == 2
    out, error = capfd.readouterr()
    assert out == "" and error.count("\n") == 1 and error.startswith("otwarp: ")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("count", ['"x"', "-1", "true"])
def test_counts_of_tilts_that_are_not_there_are_looked_at(tmp_path: Path, count: str) -> None:
    text = TEXT.replace("between = 1", "")
    with pytest.raises(InputError, match=r"depth, between_count, is .*; allowed: a whole number, 0 to 100000"):
        labels(tmp_path, text.replace("between_count = 6", f"between_count = {count}"))
    assert labels(tmp_path, text.replace("between_count = 6", "between_count = 0")).poses == 3
