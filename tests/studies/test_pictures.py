"""Pictures where all trials, or some, were censored: bounds, not empty axes; survival curves of points of a map."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from otwarp.cli.main import main
from otwarp.studies import figure
from otwarp.studies.axes import values
from otwarp.studies.engines.run import prepare, run_study
from otwarp.studies.observables import first_passage, trapped
from otwarp.studies.rare.figure import draw_escapes
from otwarp.studies.results import table
from otwarp.studies.stopping.intervals import rate_interval
from otwarp.studies.stopping.rules import trials
from otwarp.studies.store import Store
from otwarp.studies.study import Study
from otwarp.studies.survival_figure import curves_of
from tests.studies.scenes import bead_in_a_well

pytest.importorskip("zarr")

N = 32


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


@pytest.fixture(scope="module")
def study(scene) -> Study:
    """Two powers from three places: nobody escapes from the middle or at the higher power, nearly all from the rim."""
    axes = {
        "trap_power": values([0.1, 4.0], unit="mW"),
        "start.x:/World/bead": values([0.0, 200.0, 395.0], unit="nm"),
    }
    return Study(scene, axes=axes, observables=[first_passage(), trapped(until=0.004)], stop=trials(N), seed=3)


@pytest.fixture(scope="module")
def store(study, tmp_path_factory) -> Store:
    return run_study(study, tmp_path_factory.mktemp("store") / "out", devices=["cpu"])


@pytest.fixture
def drawn(monkeypatch) -> list[Any]:
    """Figures that would have been written."""
    kept: list[Any] = []
    monkeypatch.setattr(figure, "save_picture", lambda made, _: kept.append(made))
    return kept


def test_the_middle_of_a_well_is_not_left(store):
    found = table(store)
    events = found["first_passage_events"].values
    assert events[0, 0] == events[1, 0] == 0 and events[0, 2] > N // 2


def test_a_curve_of_rates_none_of_which_was_seen(store, drawn):
    """At the upper ends of the intervals, marked as bounds, and no negative rate on the axis."""
    figure.draw(store, Path("a.png"), at={"start_x_bead": 0.0})
    (axes,) = drawn[0].axes
    marks = [line for line in axes.lines if line.get_marker() == "v"]
    bound = table(store)["first_passage_rate_high"].values[:, 0]
    assert np.allclose(marks[0].get_ydata(), bound) and np.all(bound > 0.0)
    assert axes.get_ylim()[0] == 0.0 and axes.get_ylim()[1] > bound.max() and "none seen" in axes.get_title()


def test_a_map_of_rates_some_of_which_were_not_seen(store, drawn, monkeypatch):
    """Marked; where none was seen at all, the bounds are the map."""
    figure.draw(store, Path("a.png"))
    axes, bar = drawn[0].axes
    assert [t.get_text() for t in axes.texts].count("▼") == int(np.sum(table(store)["first_passage_events"] == 0))
    assert bar.get_ylim()[0] == 0.0
    far = table(store)
    far["first_passage_rate"][1, 2] = 100.0 * far["first_passage_rate"][0, 2]
    monkeypatch.setattr(figure, "table", lambda _: far)
    figure.draw(store, Path("a.png"))
    assert isinstance(drawn.pop().axes[0].collections[0].norm, LogNorm)
    part = table(store).isel(start_x_bead=[0, 0])
    monkeypatch.setattr(figure, "table", lambda _: part)
    figure.draw(store, Path("a.png"))
    mesh = drawn[1].axes[0].collections[0].get_array()
    assert np.allclose(mesh, part["first_passage_rate_high"].values) and "upper end" in drawn[1].axes[1].get_ylabel()


def test_a_map_that_is_not_finished_says_so_and_no_contour_is_named_that_nobody_asked_for(store, drawn, monkeypatch):
    part = table(store).copy(deep=True)
    part["trials"][1, :] = 0
    part["trapped"][1, :] = np.nan
    monkeypatch.setattr(figure, "table", lambda _: part)
    monkeypatch.setattr(figure, "TRACED", 2)
    said = []
    for level in (None, 1e-6):
        figure.draw(store, Path("a.png"), name="trapped", level=level)
        said.append(drawn[-1].axes[0].get_title())
    assert drawn[0].get_suptitle() == f"{3 * N} trials, 3 of 6 points so far"
    assert said == ["", "no contour: P is nowhere 1e-06"]


def test_survival_of_points_along_an_axis(store, drawn):
    """A curve for each, from 1 at 0 to its last share at the horizon; of nothing seen the bound of its count."""
    figure.draw(store, Path("a.png"), survival=True, at={"trap_power": 0.12})
    (axes,) = drawn[0].axes
    curves = curves_of(store, "first_passage", {"trap_power": 0})
    assert [c.label for c in curves] == ["0 nm", "200 nm", "395 nm"] and len(axes.lines) == 3
    found = table(store).isel(trap_power=0)
    for n, c in enumerate(curves):
        assert c.events == found["first_passage_events"].values[n] and c.trials == N
        assert c.time[0] == 0.0 and c.time[-1] == pytest.approx(0.004) and c.share[0] == 1.0
        assert c.share[-1] == pytest.approx(1.0 - c.events / N)  # none was censored before
        assert np.all((c.low <= c.share) & (c.share <= c.high))
    none = curves[0]
    assert none.low[-1] == pytest.approx(0.025 ** (1.0 / N))
    text = axes.get_legend().get_texts()[0].get_text()
    assert text == f"0 nm: none in {N} trials, < {rate_interval(0, N * 0.004)[1]:.2g} 1/s"


def test_what_cannot_be_drawn(store, tmp_path, capsys):
    """One line each."""
    line = ["study", "show", str(store.folder)]
    plot = ["--plot", str(tmp_path / "a.png")]
    for more, said in (
        (["--survival"], "--survival; allowed with --plot"),
        (["--at", "trap_power=1"], "--at; allowed with --plot"),
        ([*plot, "--at", "trap_power"], "--at is trap_power; allowed: an axis and a number"),
        ([*plot, "--at", "trap_powr=1"], "--at has the axis 'trap_powr'; allowed: trap_power, start_x_bead"),
        ([*plot, "--at", "trap_power=1", "--at", "trap_power=2"], "--at trap_power is given 2 times; allowed: once"),
        ([*plot, "--survival", "--observable", "trapped"], "--survival of trapped; allowed: a time"),
    ):
        assert main([*line, *more]) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1
    assert main([*line, *plot, "--survival"]) == 0 and (tmp_path / "a.png").stat().st_size > 1000


def test_a_picture_with_json_prints_one_value_alone(store, tmp_path, capsys):
    """The rows of the table, as without a picture, whose file is named on standard error."""
    line = ["study", "show", str(store.folder), "--json"]
    assert main(line) == 0
    rows = capsys.readouterr().out
    for more in ([], ["--contour", "0.5", "--observable", "trapped"]):
        assert main([*line, *more, "--plot", str(tmp_path / "a.png")]) == 0
        said = capsys.readouterr()
        assert said.out == rows and len(json.loads(rows)) == 6 and "wrote" in said.err


@pytest.mark.filterwarnings("error")
def test_no_contour_of_a_study_that_has_not_run(study, tmp_path, capsys):
    """Refused as a picture is."""
    empty = tmp_path / "out"
    prepare(study, empty)
    for more in (["--contour", "0.5"], ["--plot", str(tmp_path / "a.png")]):
        assert main(["study", "show", str(empty), *more]) == 2
        assert "out: no point is computed yet; allowed: a study that has run" in capsys.readouterr().err


def test_a_contour_that_is_nowhere(store, capsys):
    """Said, with what the map has; one that is there is printed."""
    asked = ["study", "show", str(store.folder), "--observable", "trapped", "--contour"]
    assert main([*asked, "0.5"]) == 0
    assert "estimate" in (found := capsys.readouterr().out) and "no contour" not in found
    low = float(table(store)["trapped"].min())
    assert low > 0.0 and main([*asked, str(0.5 * low)]) == 0
    said = capsys.readouterr().out
    assert f"no contour: P(trapped) is {low:.4g} to 1 on this map, nowhere {0.5 * low:g}" in said


def escapes(rate: float) -> Any:
    """A table of escapes over one axis, at one point of which none was seen."""
    import xarray

    time, low = np.array([2.0, np.inf]), np.array([1.0, 50.0])
    found = xarray.Dataset(coords={"trap_power": ("trap_power", [0.1, 0.2], {"units": "mW"})})
    parts = {"escape_time": time, "escape_time_low": low, "escape_time_high": np.array([4.0, np.inf])}
    parts |= {"trials": np.array([4, 4]), "steps": np.array([10.0, 10.0]), "step_ratio": np.array([rate, np.nan])}
    for name, column in (parts | {"step_ratio_error": np.array([0.1, np.nan])}).items():
        found[name] = ("trap_power", column)
    found.attrs = {"method": "forward-flux", "order": "distance"}
    return found


@pytest.mark.parametrize("seen", [1.0, np.nan])
def test_escapes_that_were_not_seen(seen):
    """A bound from below on the mean time; no empty axes for ratios that nothing is known of."""
    made = Figure()
    draw_escapes(made, escapes(seen))
    upper = made.axes[0]
    bounds = next(line for line in upper.lines if line.get_marker() == "^")
    assert bounds.get_xydata().tolist() == [[0.2, 50.0]] and "none seen" in upper.get_title()
    assert upper.get_ylim()[1] > 50.0 and len(made.axes) == 1 + np.isfinite(seen)
