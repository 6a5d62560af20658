from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from otwarp.errors import InputError
from otwarp.record import figure
from otwarp.record.footprint import hull, outlines
from otwarp.record.read import read_run
from otwarp.record.recorder import Recorder
from otwarp.scene import Scene
from tests.record.small_run import HELD, RATE, frame


def run(scene: Scene, folder: Path, frames: list, held: tuple = HELD) -> Path:
    options = {"frames_per_second": RATE, "held": held, "time_step": 1e-3, "usd_world": None, "figure": False}
    with Recorder(scene, folder, **options) as out:
        for item in frames:
            out.write(item)
    return folder


def panels(folder: Path) -> list[str]:
    return [name for name, _ in figure.time_panels(read_run(folder / "run.nc"))]


def test_the_figure_is_drawn_from_the_netcdf_file_alone(scene: Scene, tmp_path: Path) -> None:
    folder = run(scene, tmp_path / "run", [frame(scene, i) for i in range(30)])
    assert scene.file is not None
    scene.file.unlink()
    path = figure.draw(folder)
    assert path == folder / "figure.png"
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB"), dtype=float)
    assert min(pixels.shape[:2]) > 600
    # the colours of both robots, of the obstacle, and of warning lines and arrows are in it
    for colour in ((36, 96, 167), (217, 130, 43), (223, 225, 230), (198, 40, 40)):
        assert (np.abs(pixels - colour).max(axis=2) < 12).sum() > 50
    assert panels(folder) == ["force", "distance"]


def test_panels_that_say_nothing_are_left_out(scene: Scene, tmp_path: Path) -> None:
    no_force = [frame(scene, i, contact_force=np.zeros((1, 6, 3)), contact_load=np.zeros((1, 6))) for i in range(3)]
    assert panels(run(scene, tmp_path / "force", no_force)) == ["distance"]
    assert panels(run(scene, tmp_path / "one", [frame(scene, 0)])) == []
    bare = dataclasses.replace(scene, traps=(), goal=None, obstacles=(), bodies=scene.bodies[:1])
    folder = run(bare, tmp_path / "bare", [frame(scene, i, **_only_first(frame(scene, i))) for i in range(3)], held=())
    assert panels(folder) == ["force"]
    assert figure.draw(folder).is_file()
    assert figure.draw(tmp_path / "one").is_file()


def _only_first(item) -> dict[str, np.ndarray]:
    names = ("position", "orientation", "contact_force", "contact_load")
    traps = ("trap_position", "trap_power", "trap_force", "trap_distance", "escape_time")
    return {n: getattr(item, n)[:, :1] for n in names} | {n: getattr(item, n)[:, :0] for n in traps}


def test_a_crowd_and_nan_distances_are_drawn(scene: Scene, tmp_path: Path) -> None:
    many = tuple(
        dataclasses.replace(scene.bodies[3], instance=i, position=(2.5 * (i % 8), 2.5 * (i // 8), 5.0))
        for i in range(40)
    )
    crowd = dataclasses.replace(scene, bodies=(*scene.bodies[:3], *many))
    frames = [frame(crowd, i, trap_distance=np.array([[np.nan, 0.2]])) for i in range(3)]
    folder = run(crowd, tmp_path / "run", frames)
    data = read_run(folder / "run.nc")
    assert (data.position.shape[1], len(data.rest)) == (3, 40)
    assert np.isinf(data.distance[:, 0]).all()
    assert figure.draw(folder, out=tmp_path / "elsewhere.png").is_file()


def test_a_path_has_a_gap_where_its_body_came_in_on_another_side(scene: Scene, tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    around = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, period=(100.0, 0.0, 0.0)))
    frames = [frame(scene, i) for i in range(6)]
    frames = [
        dataclasses.replace(f, unwrapped=f.position + np.array([100.0 * (i > 2), 0, 0])) for i, f in enumerate(frames)
    ]
    found = read_run(run(around, tmp_path / "run", frames) / "run.nc")
    assert np.flatnonzero(found.jumped[:, 0]).tolist() == [3]
    np.testing.assert_allclose(figure._middle(found, np.arange(6), 0), found.position[3, 0, :2])
    axes = Figure().add_subplot()
    figure._draw_path(axes, found, 0)
    (line,) = axes.lines
    assert np.flatnonzero(np.isnan(np.asarray(line.get_xdata()))).tolist() == [3] and len(line.get_xdata()) == 7


def test_rods_are_rectangles_and_a_lone_bead_is_none_of_a_robot(scene: Scene, tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    folder = run(scene, tmp_path / "run", [frame(scene, i, worlds=2) for i in range(3)])
    found = read_run(folder / "run.nc", 1)
    axes = Figure().add_subplot()
    figure._draw_distance(axes, found)
    assert axes.get_ylabel() == "bead–trap distance (µm)"
    low, high = figure.map_limits(found)
    figure._draw_map(axes, found, low, high)
    assert [text.get_text() for text in axes.texts if "world" in text.get_text()] == ["world 1 of 2"]
    still = np.tile([0.0, 0.0, 0.0, 1.0], (*found.orientation.shape[:2], 1))
    rods = [np.array([[0.0, -4.0, 0.0, 0.0, 4.0, 0.0, 0.5]])] * len(found.spheres)
    found = dataclasses.replace(found, rods=rods, orientation=still)
    (rod,) = figure._rods(found, 0, 0)
    np.testing.assert_allclose(np.ptp(rod.get_xy(), axis=0), [1.0, 8.0])
    figure._draw_distance(axes, found)
    assert axes.get_ylabel() == "robot–trap distance (µm)"


def test_no_run_no_figure(scene: Scene, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"run\.nc: file = missing"):
        figure.draw(tmp_path)
    (tmp_path / "run.nc").write_bytes(b"not netCDF")
    with pytest.raises(InputError, match=r"run\.nc: contents = "):
        figure.draw(tmp_path)
    folder = run(scene, tmp_path / "run", [frame(scene, 0)])
    with pytest.raises(InputError, match=r"world = 1; allowed: 0 … 0"):
        figure.draw(folder, world=1)


def test_outlines_are_the_shadows_of_the_obstacles() -> None:
    def still(shape: str, size: tuple[float, float, float], **more: object) -> dict:
        turn = [0.0, 0.0, np.sin(np.pi / 8), np.cos(np.pi / 8)]
        pose = {"position": {"times": [0.0, 1.0], "values": [[1.0, 2.0, 3.0], [3.0, 2.0, 3.0]]}}
        return {"shape": shape, "size": size, "orientation": {"times": [0.0], "values": [turn]}, **pose, **more}

    (box,) = outlines(still("box", (1.0, 1.0, 4.0)), 0.5, 0.0, 1.0)
    corners = np.array([2.0, 2.0]) + np.sqrt(2.0) * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    assert sorted(map(tuple, box.round(9))) == sorted(map(tuple, corners.round(9)))
    assert outlines(still("box", (1.0, 1.0, 1.0)), 0.5, 5.0, 6.0) == []
    for shape in ("cylinder", "capsule", "sphere"):
        (circle,) = outlines(still(shape, (2.0, 1.0, 0.0)), 0.0, 0.0, 9.0)
        np.testing.assert_allclose(np.linalg.norm(circle - [1.0, 2.0], axis=1), 2.0)
    assert outlines(still("plane", (0.0, 0.0, 0.0)), 0.0, -1e9, 1e9) == []
    mesh = still("mesh", (0.0, 0.0, 0.0), vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangles=[[0, 1, 2]])
    assert [p.shape for p in outlines(mesh, 0.0, 0.0, 9.0)] == [(3, 2)]


def test_hull_of_a_square_with_points_inside() -> None:
    inside = np.random.default_rng(0).uniform(0.1, 0.9, (50, 2))
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    np.testing.assert_array_equal(hull(np.concatenate([inside, square, [[0.5, 0.0]]])), square)


def test_running_mean_of_a_line_is_the_line_and_gaps_do_not_spread() -> None:
    line = np.linspace(0.0, 1.0, 801)
    mean = figure.running_mean(line)
    assert mean is not None
    np.testing.assert_allclose(mean[20:-20], line[20:-20])
    gap = line.copy()
    gap[400] = np.nan
    mean = figure.running_mean(gap)
    assert mean is not None
    assert np.isfinite(mean).all()
    assert figure.running_mean(line[:100]) is None


def test_round_number() -> None:
    assert [figure.round_number(v) for v in (0.011, 1.0, 4.9, 5.0, 99.0)] == [0.01, 1.0, 2.0, 5.0, 50.0]


def test_recording_loads_nothing_heavy_before_it_is_needed() -> None:
    import subprocess

    code = "import otwarp.record.recorder, otwarp.record.figure, sys; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"matplotlib", "netCDF4", "pxr", "xarray", "warp"} & set(loaded)
