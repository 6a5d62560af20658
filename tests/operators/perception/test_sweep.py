"""Sweeps: which trials there are, folders that go on, maps and what they are compared with, the command line."""

import itertools
import json
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from otwarp.cli.main import cli
from otwarp.errors import InputError
from otwarp.operators.folder import open_folder
from otwarp.operators.perception.errors import Perception
from otwarp.operators.perception.figure import PANELS, draw_maps, drawn_maps, where_it_is
from otwarp.operators.perception.folder import probes_of, run_sweep
from otwarp.operators.perception.summary import AS_GOOD, MARGIN, UNTOLD, Maps, as_good, maps_of, verdict
from otwarp.operators.perception.sweep import Sweep
from otwarp.operators.statistics import risk_difference
from tests.operators.work import study

AXES = {"delay": (0.0, 0.1), "depth_error": (0.0, 0.2, 0.4)}


def small(**changes):
    """Two operators for 0.1 s in six cells, and beside them."""
    asked = {"study": study(operators=2, duration=0.1), "axes": AXES, "chunk": 5, "repeats": 0}
    return Sweep(**{**asked, **changes})


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A small sweep with probes, computed."""
    return run_sweep(small(repeats=1), tmp_path_factory.mktemp("sweep") / "out", device="cpu")


def test_cells_and_conditions():
    sweep = small()
    assert [(p.delay, p.depth_error) for p in sweep.cells] == [
        (d, e) for d in AXES["delay"] for e in AXES["depth_error"]
    ]
    assert [(a.cell, a.felt) for a in sweep.arms] == [(-1, False), (-1, True), *((n, True) for n in range(6))]
    trials = np.concatenate([sweep.trials(n) for n in range(sweep.chunks)])
    np.testing.assert_array_equal(trials, np.arange(2 * 8))
    twin = small(base=Perception(eyes="twin"))
    assert [(a.cell, a.felt) for a in twin.arms[8:]] == [(n, False) for n in range(6)]


def visual_delays(sweep, chunk):
    """Of the operators of a chunk's trials [periods]."""
    people: Any = sweep.loop(sweep.trials(chunk), "cpu").people.people.numpy()
    return people["visual_delay"].tolist()


def test_eyes_that_look_at_a_late_twin_are_late():
    """By the 100 ms of the last three cells, which begin the second chunk."""
    twin = small(base=Perception(eyes="twin"))
    before = visual_delays(twin, 0)
    assert before == [before[0]] * 5
    assert visual_delays(twin, 1)[:3] == [before[0] + 100] * 3


def test_a_sweep_that_was_stopped_goes_on_to_the_same_bits(done, tmp_path):
    class Stop(Exception):
        pass

    def stop(part, count):
        if part == 2:
            raise Stop

    sweep = small(repeats=1)
    with pytest.raises(Stop):
        run_sweep(sweep, tmp_path / "out", device="cpu", progress=stop)
    parts = []
    stopped = run_sweep(sweep, tmp_path / "out", device="cpu", progress=lambda *part: parts.append(part))
    assert parts == [(1, 5), (2, 5), (3, 5), (4, 5), (5, 5)]
    for name, row in done.read().items():
        np.testing.assert_array_equal(stopped.read()[name], row, err_msg=name)
    for name, row in probes_of(done).items():
        np.testing.assert_array_equal(probes_of(stopped)[name], row, err_msg=name)


def test_another_sweep_is_refused_in_its_folder(done):
    with pytest.raises(InputError, match="holds a study with another"):
        run_sweep(small(repeats=1, base=Perception(lost=0.1)), done.path, device="cpu")


def test_maps_are_set_against_no_error_and_no_haptics(done):
    found = maps_of(done)
    assert found.operators == 2
    assert found.maps["success"].shape == found.maps["phase_1hz"].shape == (2, 3, 1, 1, 1)
    first = found.at((0, 0, 0, 0, 0))
    assert first["success_minus_perfect"] == 0.0 and first["contact_mean_minus_perfect"] == 0.0
    for name in ("contact_mean", "force_rmse_pn", "phase_5hz", "gain_1hz"):
        assert first[name] == found.beside["perfect"][name], name
    assert np.isnan(found.beside["without"]["force_rmse_pn"])
    late = found.at((1, 0, 0, 0, 0))
    assert late["phase_1hz"] < -20.0 < first["phase_1hz"] < 0.0
    assert late["force_rmse_pn"] > first["force_rmse_pn"]


def test_only_whole_operators_count(tmp_path):
    sweep = small(chunk=9)
    folder = run_sweep(sweep, tmp_path / "out", device="cpu")
    (folder.path / "done" / "000001").unlink()
    assert maps_of(folder).operators == 1


@pytest.mark.parametrize(
    ("ends", "said"),
    [
        ({"perfect": (-0.3, -0.1), "without": (-0.2, 0.1)}, "worse"),
        ({"perfect": (-0.3, -0.1), "without": (-0.3, -0.1)}, "worse than no haptics"),
        ({"perfect": (-0.3, 0.1), "without": (0.1, 0.3)}, "not told"),
    ],
)
def test_verdicts_go_by_intervals(ends, said):
    more, less = {}, {}  # more deliveries are better, and less force is
    for other, (low, high) in ends.items():
        more |= {f"success_minus_{other}_low": low, f"success_minus_{other}_high": high}
        less |= {f"contact_mean_minus_{other}_low": -9.0 * high, f"contact_mean_minus_{other}_high": -9.0 * low}
    assert verdict(more, "success") == verdict(less, "contact_mean") == said


@pytest.mark.parametrize(("what", "margin"), list(MARGIN.items()))
def test_a_cell_is_as_good_as_no_error_up_to_a_margin(what, margin):
    """By the end of the interval at which it is worse: just within the margin it is, at the margin it is not."""
    for worst, said in ((0.999 * margin, AS_GOOD), (margin, UNTOLD)):
        row = {f"{what}_minus_without_low": -9.0, f"{what}_minus_without_high": 9.0}
        low, high = (-worst, 0.01) if what == "success" else (-0.01, worst)
        row |= {f"{what}_minus_perfect_low": low, f"{what}_minus_perfect_high": high}
        assert verdict(row, what) == said


def test_few_operators_show_nowhere_that_a_cell_is_as_good():
    """Of outcomes that are the same with errors as without: 17 operators leave the margin open, 18 do not."""
    for operators, shown in ((2, False), (17, False), (18, True), (96, True)):
        made = np.arange(operators) % 2 == 0
        same = risk_difference(made, made)
        bound = np.full((2, 2), as_good(same.low, same.high, "success"))
        assert (bound < 0.0).all() == shown, operators
        said = where_it_is(bound < 0.0, "perfect", operators)
        assert said == (" (everywhere)" if shown else f" (nowhere shown by {operators} operators)")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"axes": {"colour": (1.0,)}}, "axis is 'colour'"),
        ({"axes": {"delay": (0.1, 0.0)}}, "delay is"),
        ({"axes": {"delay": (2.0,)}}, "delay is 2.0"),
        ({"chunk": 0}, "chunk"),
    ],
)
def test_what_cannot_be_is_refused(wrong, said):
    with pytest.raises(InputError, match=said):
        small(**wrong)


@pytest.mark.parametrize("axes", [{"delay": (0.0, 0.1), "tilt_error": (0.0, 10.0)},
                                  {"lateral_error": (0.0, 0.2), "frame_rate": (60.0, 120.0)}])  # fmt: skip
def test_any_two_axes_make_a_map(axes, tmp_path):
    """Of one operator for 0.05 s, without probes: every cell has its own perception, and the map its picture."""
    sweep = small(study=study(operators=1, duration=0.05), axes=axes, chunk=6)
    first, second = sorted(axes, key=list(sweep.grid).index)
    assert [(getattr(p, first), getattr(p, second)) for p in sweep.cells] == [
        (a, b) for a in axes[first] for b in axes[second]
    ]
    found = maps_of(run_sweep(sweep, tmp_path / "out", device="cpu"))
    assert [name for name, values in found.axes.items() if len(values) > 1] == [first, second]
    assert draw_maps(found, tmp_path / "map.png").stat().st_size > 10_000
    errors = np.squeeze(found.maps["force_rmse_pn"])
    assert errors.shape == (2, 2) and np.unique(errors).size == 4


def made_up(delays: int, errors: int) -> Maps:
    """Maps over so many delays and depth errors, of operators who deliver nowhere and show little."""
    axes = {"delay": np.arange(delays) * 0.05, "depth_error": np.arange(errors) * 0.05}
    shape = (delays, errors)
    maps = {name: np.random.default_rng(1).normal(size=shape) for name in PANELS} | {"success": np.zeros(shape)}
    for name in ("success", "contact_mean"):
        for other in ("perfect", "without"):
            maps |= {
                f"{name}_minus_{other}_low": np.full(shape, -9.0),
                f"{name}_minus_{other}_high": np.full(shape, 9.0),
            }
    return Maps(axes, maps, {}, 16_384, {})


@pytest.mark.parametrize(("delays", "errors"), [(11, 7), (101, 61), (2, 2)])
def test_a_map_has_room_and_its_labels_can_be_read(delays, errors):
    """Of `--delay 0:500:50 --depth-error 0:0.3:0.05`, of many more cells, and of few, with the longest of legends."""
    found = made_up(delays, errors)
    figure = drawn_maps(found, ["delay", "depth_error"], {"small": 0.03}, 20.0)
    figure.draw_without_rendering()
    whole = figure.bbox
    maps, bars = figure.axes[:4], figure.axes[4:]
    for axis in maps:
        box = axis.get_window_extent()
        assert box.width > 0.3 * whole.width and box.height > 0.35 * whole.height
        for labels, side in ((axis.get_xticklabels(), 0), (axis.get_yticklabels(), 1)):
            ends = [(e.get_points()[0, side], e.get_points()[1, side]) for e in (t.get_window_extent() for t in labels)]
            assert len(ends) > 1 and all(end < start for (_, end), (start, _) in itertools.pairwise(ends))
        if (legend := axis.get_legend()) is not None:
            assert legend.get_window_extent().x1 <= whole.x1
    assert maps[0].get_xticklabels()[0].get_text() == "0"
    assert bars[0].get_ylim() == (0.0, 1.0), "shares of deliveries"


def test_the_command_line(done, tmp_path):
    out = tmp_path / "out"
    line = ["operators", "sweep", "scenes/cell_delivery.usda", "--delay", "0:100:100", "--depth-error", "0,0.01,0.02"]
    line += ["--depth-range", "20", "--operators", "1", "--duration", "0.05", "--probes", "0", "--device", "cpu"]
    ran = CliRunner().invoke(cli, [*line, "--out", str(out)], catch_exceptions=False)
    assert ran.exit_code == 0 and "1 simulated operators are done in 6 cells" in ran.output
    assert open_folder(out).asked()["perception"]["axes"]["depth_error"] == [0.0, 0.2, 0.4]
    said = CliRunner().invoke(cli, ["operators", "show", str(done.path), "--json"], catch_exceptions=False)
    found = json.loads(said.output)
    assert found["simulated"] is True and len(found["cells"]) == 6
    table = CliRunner().invoke(cli, ["operators", "show", str(done.path)], catch_exceptions=False)
    assert "2 SIMULATED operators" in table.output and "no haptics" in table.output
    head = next(line for line in table.output.splitlines() if "delivered" in line)
    assert all(word in head for word in ("lost", "sway", "cycles", "deliveries are")) and "…" not in table.output
    picture, data = tmp_path / "map.png", tmp_path / "map.nc"
    drawn = [
        "operators",
        "show",
        str(done.path),
        "--plot",
        str(picture),
        "--export",
        str(data),
        "--network",
        "ours=0.3",
    ]
    assert CliRunner().invoke(cli, drawn, catch_exceptions=False).exit_code == 0
    assert picture.stat().st_size > 10_000

    import xarray

    with xarray.open_dataset(data) as table:
        assert table["success"].dims == ("delay", "depth_error", "tilt_error", "frame_rate", "lateral_error")
        assert table["force_rmse_pn"].attrs["units"] == "pN" and "simulated" in table.attrs["note"]
        assert all(table[name].attrs["units"] and table[name].attrs["long_name"] for name in table.variables)
        assert table["success_minus_without_low"].attrs["long_name"] == (
            "share of simulated trials that deliver, less that without haptics, low end of the 95 % interval"
        )


@pytest.mark.parametrize("wrong", ["0:500", "0:500:0", "5:1:1,", "1,0", "a", "", "0:1:1e-9", "0,2000"])
def test_values_that_are_none_are_refused(wrong, tmp_path):
    line = ["operators", "sweep", "scenes/cell_delivery.usda", "--delay", wrong, "--out", str(tmp_path / "out")]
    ran = CliRunner().invoke(cli, line)
    assert isinstance(ran.exception, InputError | SystemExit) and "--delay is" in str(ran.exception or ran.output)
