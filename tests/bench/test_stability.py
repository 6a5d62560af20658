"""Stress tests: the closed forms, the verdicts, and that a defect does not pass as anything else."""

from __future__ import annotations

import json
import math
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from otwarp.bench import closed_forms
from otwarp.bench.radial_wells import SHAPES
from otwarp.bench.scenes import PLACE, bead, resting, robot, scene, spring
from otwarp.bench.stability import random_scenes
from otwarp.bench.stability.grids import GRIDS, INTEGRATORS
from otwarp.bench.stability.laws import time_in_a_well
from otwarp.bench.stability.measure import Task, bench_stability, chosen_grids, run_tasks
from otwarp.bench.stability.mechanical import dragged_bead, first_overlap, pressed_pair, pulled_onto, trap_jump
from otwarp.bench.stability.table import plain
from otwarp.bench.stability.thermal import (
    Effort,
    RobotModes,
    advance,
    bead_variance,
    check_state,
    long_run,
    resting_height,
    robot_equipartition,
    simulate,
)
from otwarp.bench.stability.verdict import CellVerdict, Defect, Deviation, judge
from otwarp.cli.main import main
from otwarp.errors import InputError, PlausibilityWarning, SimulationError
from otwarp.record.run import record_run
from otwarp.scene import Scene, SceneBuilder, Track

QUADRATURE = 1e-4
"""Of a midpoint rule over a kink, at the worst."""


@pytest.fixture(scope="module")
def effort(device) -> Effort:
    return Effort(device=device, worlds=1024, random_scenes=2, steps=10_000)


def test_height_on_a_hard_floor_is_half_a_gaussian():
    k, energy = 20.0, 4e-3
    width = math.sqrt(energy / k)
    mean, spread = closed_forms.mean_height(k, 0.0, 1e14, energy)
    assert mean == pytest.approx(width * math.sqrt(2.0 / math.pi), rel=QUADRATURE)
    assert spread == pytest.approx(width * math.sqrt(1.0 - 2.0 / math.pi), rel=QUADRATURE)
    mean, spread = closed_forms.mean_height(k, 0.03, 0.0, energy)
    assert (mean, spread) == (pytest.approx(-0.03, rel=QUADRATURE), pytest.approx(width, rel=QUADRATURE))


def test_overlaps_follow_hertz():
    hard = closed_forms.hardness(1e4, 0.5, bodies=2)
    delta = closed_forms.pressed_overlap(hard, lambda d: 7.0 - d, 1.0)
    assert hard * delta**1.5 == pytest.approx(7.0 - delta)
    assert closed_forms.hardness(1e4, 0.5, bodies=1) == pytest.approx(2.0 * hard)
    times = np.array([0.01, 0.02])
    # a point that is pushed with −K·x^{3/2} is the overlap of two free spheres
    found = closed_forms.followed(lambda x: -hard * np.maximum(x, 0.0) ** 1.5, np.array([0.3]), 60.0, times)
    exact = [closed_forms.relaxed_overlap(0.3, hard, 60.0, t) for t in times]
    assert found[:, 0] == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        (Deviation(error=0.009), CellVerdict.ACCURATE),
        (Deviation(error=-0.02, standard_error=0.004), CellVerdict.ACCURATE),
        (Deviation(error=0.05), CellVerdict.STABLE),
        (Deviation(error=0.5, predicted=0.52), CellVerdict.STABLE),
        (Deviation(error=0.5, predicted=0.3), CellVerdict.WRONG),
        (Deviation(error=-0.08, standard_error=0.003, told=0.07), CellVerdict.STABLE),
        (Deviation(error=-0.08, told=0.07), CellVerdict.WRONG),
        (Deviation(error=0.12, told=0.13), CellVerdict.STABLE),
        (Deviation(error=0.12), CellVerdict.WRONG),
        (Deviation(error=0.12, standard_error=0.005), CellVerdict.STABLE),
        (Deviation(error=math.nan), CellVerdict.WRONG),
        (Deviation(error=math.inf, predicted=math.inf), CellVerdict.WRONG),
    ],
)
def test_verdicts(found, verdict):
    assert found.verdict is verdict
    cell = judge("r", "c", lambda: found)
    assert cell.verdict is verdict and bool(cell.message) == (verdict is CellVerdict.WRONG)
    json.dumps(cell.json(), allow_nan=False)


def raising(error: Exception):
    def measure() -> Deviation:
        raise error

    return measure


def test_a_clear_refusal_is_no_defect_and_an_unclear_one_is():
    stop = SimulationError("stopped", world=0, body="/B", step=3, time=0.1)
    assert judge("", "", raising(InputError("time step is 1 s; allowed: less"))).verdict is CellVerdict.REFUSED
    assert judge("", "", raising(stop)).verdict is CellVerdict.STOPPED
    assert judge("", "", raising(InputError("two\nlines"))).verdict is CellVerdict.WRONG
    assert judge("", "", raising(Defect("nan"))).verdict is CellVerdict.WRONG
    assert judge("", "", lambda: None).verdict is CellVerdict.STABLE
    with pytest.raises(ZeroDivisionError):
        judge("", "", raising(ZeroDivisionError()))


def test_a_warning_makes_a_large_error_a_stated_one():
    def measure() -> Deviation:
        warnings.warn("too coarse", stacklevel=1)
        return Deviation(error=0.5)

    cell = judge("", "", measure)
    assert cell.verdict is CellVerdict.STABLE and cell.warned == ("too coarse",)


def test_an_odd_scene_states_no_error():
    def measure() -> Deviation:
        warnings.warn("25 K", PlausibilityWarning, stacklevel=1)
        return Deviation(error=0.5)

    cell = judge("", "", measure)
    assert cell.verdict is CellVerdict.WRONG and cell.warned == ()


def test_cells_of_all_grids_have_places_of_their_own(effort):
    for grid in GRIDS:
        places = [(row, column) for row, column, _ in grid.cells(effort)]
        assert places and len(set(places)) == len(places), grid.name
    assert {g.name for g in chosen_grids((), quick=True)} < {g.name for g in chosen_grids((), quick=False)}
    assert [g.name for g in chosen_grids(("crowd",), quick=True)] == ["crowd"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"grids": ["chess"]}, "--grid is 'chess'; allowed: step, laws, power"),
        ({"quick": True, "long": True}, "--quick comes with --long"),
        ({"processes": 0}, "--processes is 0; allowed: 1 or more"),
    ],
)
def test_bad_input(options, words):
    with pytest.raises(InputError, match=words) as caught:
        bench_stability(device="cpu", **options)
    assert "\n" not in str(caught.value)


def test_a_grid_holds_what_its_cells_found(effort, tmp_path: Path):
    said: list[str] = []
    found = bench_stability(grids=["overlap"], device=effort.device, effort=effort, note=said.append)
    assert said[0] == "overlap: 100, 0" and len(said) == 54
    grid = found.grids[0]
    for row in grid.rows:
        for column in grid.columns:
            cell = grid.cell(row, column)
            assert cell is not None
            # refused where a sphere would start inside another
            stopped = CellVerdict.REFUSED if float(column) >= 1.9 else CellVerdict.STOPPED
            assert cell.verdict is (stopped if float(column) > 0.5 else CellVerdict.ACCURATE), cell
    assert found.counts[CellVerdict.STOPPED] + found.counts[CellVerdict.REFUSED] == 18 and not found.wrong
    text = plain(found)
    assert "A    36  accurate" in text and "first refusal: spheres overlap by more than half" in text
    file = tmp_path / "found.json"
    found.save(file)
    read = json.loads(file.read_text())
    assert read["counts"]["accurate"] == 36 and len(read["grids"][0]["cells"]) == 54
    assert list(tmp_path.iterdir()) == [file]


def test_cells_are_the_same_in_other_processes(effort):
    tasks = [Task(effort=effort, grid="overlap", number=n) for n in (5, 4, 8)]
    alone, beside = (dict(run_tasks(tasks, n)) for n in (1, 2))
    assert alone == beside
    assert [alone[t].verdict.value for t in tasks] == ["A", "A", "R"]


def test_springs_beads_and_robots_are_as_accurate_as_predicted(effort):
    for cell in (
        judge("bead", "", lambda: bead_variance(effort)),
        judge("cold", "", lambda: bead_variance(effort, temperature=0.0)),
        judge("robot", "", lambda: robot_equipartition(effort)),
        judge("long", "", lambda: long_run(effort, steps=4000, worlds=64)),
    ):
        assert cell.verdict is CellVerdict.ACCURATE, cell
    # near the largest stable step Heun's variance is far off, and otwarp says by how much
    near = judge("robot", "0.9", lambda: robot_equipartition(effort, factor=0.9, stable=True))
    assert near.verdict is CellVerdict.STABLE and near.predicted is not None and near.predicted < -0.5
    assert judge("", "", lambda: robot_equipartition(effort, factor=1.01, stable=True)).verdict is CellVerdict.REFUSED


def test_far_from_the_origin_a_bead_is_not_silently_wrong(effort):
    far = (1e5, PLACE[1], PLACE[2])
    cell = judge("", "", lambda: bead_variance(effort, power=1000.0, place=far))
    assert cell.verdict is CellVerdict.STABLE and "rounding of float32 coordinates" in cell.warned[0]
    near = judge("", "", lambda: bead_variance(effort, power=1000.0))
    assert near.verdict is CellVerdict.ACCURATE and not near.warned


def test_contact_drag_and_jumps_follow_their_closed_forms(effort):
    for cell in (
        judge("pair", "", lambda: pressed_pair(effort, modulus=3e9, ratio=30.0)),
        judge("overlap", "", lambda: first_overlap(effort, modulus=1e2, overlap=0.49)),
        judge("floor", "", lambda: pulled_onto(effort, shape="plane", modulus=1e6, jump=20.0)),
        judge("drag", "", lambda: dragged_bead(effort, speed=1e4)),
        judge("jump", "", lambda: trap_jump(effort, law="piecewise", jump=1.0)),
        judge("lost", "", lambda: trap_jump(effort, law="piecewise", jump=2.0)),
    ):
        assert cell.verdict is CellVerdict.ACCURATE, cell


def test_a_soft_bead_on_a_floor_is_found_where_boltzmann_has_it(effort):
    cell = judge("", "", lambda: resting_height(effort, modulus=1e2, below=0.0, step=0.5))
    assert cell.verdict in (CellVerdict.ACCURATE, CellVerdict.STABLE), cell


@pytest.mark.parametrize("how", [("heun", 0.05), ("exponential", 0.01)], ids=lambda h: h[0])
def test_beads_leave_the_papers_law_when_they_should(effort, how):
    """4096 beads, standard error 1.2 %; the steps of a spring made them leave 10 and 14 % too early."""
    found = judge("", "", lambda: time_in_a_well(effort, law="the paper's radial law", how=how))
    assert found.verdict in (CellVerdict.ACCURATE, CellVerdict.STABLE), found.message


@pytest.mark.validate
@pytest.mark.parametrize("accuracy", [0.01, 0.05])
@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("law", SHAPES)
def test_beads_leave_every_law_when_they_should(device, law, integrator, accuracy):
    """65,536 beads, standard error 0.3 %: within the accuracy, or as told."""
    effort = Effort(device=device, worlds=16384)
    found = judge("", "", lambda: time_in_a_well(effort, law=law, how=(integrator, accuracy)))
    assert found.verdict in (CellVerdict.ACCURATE, CellVerdict.STABLE), found.message


def test_a_wrong_law_is_found_out(effort, monkeypatch, capfd):
    right = closed_forms.hardness
    monkeypatch.setattr(closed_forms, "hardness", lambda *a, **k: 10.0 * right(*a, **k))
    cell = judge("", "", lambda: pressed_pair(effort, modulus=1e2, ratio=1.0))
    assert cell.verdict is CellVerdict.WRONG and cell.message.startswith("error ")
    assert main(["bench", "stability", "--quick", "--grid", "pair", "--device", str(effort.device)]) == 1
    assert "SILENTLY WRONG, " in capfd.readouterr().out


def test_a_sound_grid_exits_with_0(effort, capfd, tmp_path: Path):
    file = tmp_path / "pair.json"
    options = ["--quick", "--grid", "pair", "--device", str(effort.device), "--out", str(file)]
    assert main(["bench", "stability", *options]) == 0
    out = capfd.readouterr().out
    assert "A    24  accurate" in out and f"wrote {file}" in out and file.exists()


def test_nan_and_lost_rotations_are_defects(effort):
    sim = simulate(scene(bead(), traps=(spring(),)), effort)
    sim.state.position.assign(np.full((1, 1, 3), np.nan, dtype=np.float32))
    with pytest.raises(Defect, match="non-finite"):
        advance(sim, 3)
    turned = simulate(robot(), effort)
    advance(turned, 3)
    turned.state.orientation.assign(np.array([[[0.0, 0.0, 0.0, 1.001]]], dtype=np.float32))
    with pytest.raises(Defect, match=r"length 1 ± 0\.001"):
        check_state(turned, "this test")


def test_modes_of_the_robot_are_independent(effort):
    sim = simulate(robot(), effort)
    modes = RobotModes(sim, 20.0)
    assert np.all(modes.rates > 0.0)
    # the fastest is the rate by which otwarp chose its step; float32 mobility
    assert 1.0 / modes.rates[-1] == pytest.approx(sim.model.scales.trap_relaxation, rel=1e-4)
    assert modes.shares(sim) == pytest.approx(np.zeros((1, 6)), abs=1e-6)


def authored(what: Scene, file: Path) -> Scene:
    """The scene as read from a stage, half a second long."""
    builder = SceneBuilder(medium=what.medium, settings=replace(what.settings, duration=0.5))
    for item in (*what.bodies, *what.traps, *what.obstacles):
        builder.add(item)
    return Scene.load(builder.save(file))


def test_a_stopped_run_leaves_finite_numbers_on_disk(device, tmp_path: Path):
    import netCDF4

    # a trap that leaves for 20 µm below the floor, too strong for so soft a bead
    what = resting("plane", modulus=1e2)
    path = Track(
        times=np.array([0.0, 0.1, 0.11, 0.5]), values=np.array([PLACE, PLACE, *2 * [(*PLACE[:2], PLACE[2] - 20.0)]])
    )
    what = replace(what, traps=(replace(what.traps[0], position=path),))
    with pytest.raises(SimulationError, match="more than half the smaller radius"):
        record_run(authored(what, tmp_path / "scene.usda"), tmp_path / "run", device=device)
    with netCDF4.Dataset(tmp_path / "run" / "run.nc") as data:
        numbers = {n: v[:] for n, v in data.variables.items() if v.dtype != str and v.dtype.kind == "f"}
    frames = 7  # to 0.1 s at 60 a second
    assert {"position", "trap_position"} <= set(numbers)
    for name, values in numbers.items():
        # an escape that never was is nan
        assert name == "escape_time" or (not np.ma.is_masked(values) and np.all(np.isfinite(values))), name
    assert len(numbers["position"]) >= frames


@settings(max_examples=6, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**31), cold=st.booleans())
def test_random_scenes_are_never_silently_wrong(effort, seed, cold):
    # a robot of two spheres has fewer contacts, and a step with less room for them that would be compiled for it alone
    assume(len(random_scenes.draw(seed, cold=cold).what.bodies[-1].spheres) > 2)
    cell = judge("", "", lambda: random_scenes.run_draw(effort, seed, cold=cold))
    assert cell.verdict is not CellVerdict.WRONG, cell


def test_draws_are_the_same_everywhere_and_overlaps_are_seen(effort):
    drawn = random_scenes.draw(3, cold=True)
    assert drawn.what == random_scenes.draw(3, cold=True).what
    assert drawn.what != random_scenes.draw(4, cold=True).what
    sim = simulate(drawn.what, effort)
    apart = np.array([[-40.0, 0.0, 30.0], [0.0, 40.0, 30.0], [40.0, 0.0, 30.0]])
    sim.set_state(position=apart)
    random_scenes.check_overlaps(sim)
    for spoilt, words in (([-40.0, 0.0, 0.0], "deep in floor"), ([0.0, 0.0, 12.0], "deep in box"), (apart[1], "bead")):
        place = apart.copy()
        place[0] = spoilt
        sim.set_state(position=place)
        with pytest.raises(Defect, match=words.replace("bead", "World")):
            random_scenes.check_overlaps(sim)
