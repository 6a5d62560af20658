"""Two robots and a cell in one frame: found, cropped, and where they are to a fraction of a pixel."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.vision.fourier import Fourier
from otwarp.vision.microscope import Microscope
from otwarp.vision.rendering import Rendering, render
from otwarp.vision.sensor import Sensor
from otwarp.vision.specimen import Specimen
from otwarp.vision.tracking.finding import crop, find
from otwarp.vision.tracking.looking import save_table

PIXEL = 0.1
SIZE = 256


def frame(depth: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(SIZE, SIZE) grey levels of two dumbbells and a cell, and (3, 2) their centres [pixels], left to right."""
    rng = np.random.default_rng(seed)
    places = np.array([[-7.5, -3.0], [0.5, 6.0], [7.0, -4.5]]) + rng.uniform(-0.5, 0.5, (3, 2))
    balls, radii, indices = [], [], []
    for place, yaw in zip(places[:2], rng.uniform(0.0, np.pi, 2), strict=True):
        along = 1.1 * np.array([np.cos(yaw), np.sin(yaw), 0.0])
        for sign in (1.0, -1.0):
            balls.append([*place, depth] + sign * along)
            radii.append(1.0)
            indices.append(1.52)
    balls.append([*places[2], depth])
    radii.append(2.5)
    indices.append(1.36)
    microscope = Microscope(pixel=PIXEL)
    how = Rendering(rings=2, thickness=0.25, margin=1.0)
    image = render(Specimen.of_spheres(balls, radii, indices), microscope, SIZE, rendering=how, fourier=Fourier("cpu"))
    return Sensor().levels(image[0], seed=seed), places / PIXEL + SIZE // 2


def test_two_robots_and_a_cell_are_found() -> None:
    """In and out of focus, to a third of a pixel: the bodies are symmetric, their neighbours' fringes are not."""
    errors = []
    for depth, seed in ((0.0, 1), (1.5, 2), (-2.0, 3)):
        image, places = frame(depth, seed)
        found = find(image)
        assert len(found) == 3
        errors.append([[f.x, f.y] - place for f, place in zip(found, places, strict=True)])
        # the dumbbells are longer than wide, the cell is not
        assert [f.length > 1.25 * f.width for f in found] == [True, True, False]
        assert found[2].contrast < min(found[0].contrast, found[1].contrast)
    assert np.sqrt(np.mean(np.square(errors))) < 0.35


@pytest.mark.quick
def test_pieces_hold_what_was_found() -> None:
    image, _ = frame(0.0, 1)
    first = find(image)[0]
    piece, (column, row) = crop(image, first.x, first.y, 64)
    assert piece.shape == (64, 64)
    assert piece[32, 32] == image[row, column]
    assert abs(column - first.x) <= 0.5
    assert abs(row - first.y) <= 0.5
    again = find(piece)
    assert len(again) == 1
    assert abs(again[0].x - 32 - (first.x - column)) < 0.5
    # beyond the edge is background
    corner, _ = crop(image, 0.0, 0.0, 32, 16)
    assert corner.shape == (16, 32)
    assert np.all(corner[:8] == np.median(image).astype(image.dtype))


@pytest.mark.quick
@pytest.mark.parametrize("size", [(1, 1), (5, 4), (8, 11), (40, 40)])
def test_pieces_at_every_place_are_those_of_a_frame_that_goes_on_as_background(size: tuple[int, int]) -> None:
    """Pieces within it, which are cut without a look at its background, and those that touch or cross an edge."""
    image = np.random.default_rng(2).integers(0, 256, (12, 17), dtype=np.uint8)
    whole = np.pad(image, 50, constant_values=np.median(image).astype(np.uint8))
    wide, high = size
    for column, row in itertools.product(range(17), range(12)):
        piece, at = crop(image, column, row, wide, high)
        left, low = 50 + column - wide // 2, 50 + row - high // 2
        assert at == (column, row) and np.array_equal(piece, whole[low : low + high, left : left + wide])
        piece[...] = 0  # it is the caller's own
    assert image.max() > 200


@pytest.mark.quick
def test_an_empty_frame_holds_nothing(tmp_path: Path) -> None:
    table = save_table(tmp_path / "found.csv", []).read_text(encoding="utf-8")
    assert table.startswith("column,row,left,low,right,high") and table.count("\n") == 1
    for seed in range(20):
        assert find(Sensor().levels(np.ones((128, 128)), seed=seed)) == []
    assert find(np.full((32, 32), 100.0)) == []


@pytest.mark.quick
@pytest.mark.parametrize(
    ("image", "what"),
    [
        (np.ones((3, 3)), "frame has shape"),
        (np.ones((32, 32, 3)), "frame has shape"),
        (np.full((32, 32), np.nan), "frame has shape"),
        (np.zeros((32, 32)), "background of the frame is 0"),
    ],
)
def test_what_is_no_image_is_refused(image: np.ndarray, what: str) -> None:
    with pytest.raises(InputError, match=what):
        find(image)


@pytest.mark.quick
def test_impossible_pieces_are_refused() -> None:
    with pytest.raises(InputError, match="middle of a piece is"):
        crop(np.ones((32, 32)), 40.0, 3.0, 8)
    with pytest.raises(InputError, match="size of a piece is 0"):
        crop(np.ones((32, 32)), 4.0, 3.0, 0)
    with pytest.raises(InputError, match="scale is -1"):
        find(np.ones((32, 32)), scale=-1.0)
