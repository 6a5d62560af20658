"""Integrators against run time: the estimators against closed forms, and a tiny benchmark; no claim about speed."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import integrators as section
from benchmarks.report import PAGES, put_on_page
from otwarp.bench.integrators.cases import DEFAULT, MODELS, PLAIN, all_cases, rung
from otwarp.bench.integrators.figure import draw_integrators, error_at
from otwarp.bench.integrators.fokker_planck import Estimate
from otwarp.bench.integrators.largest_step import StepLimit, largest_step
from otwarp.bench.integrators.measure import bench_integrators, limits, references, relative
from otwarp.bench.integrators.observables import (
    OBSERVABLES,
    PANELS,
    STATIONARY,
    Mean,
    escape_mean,
    from_means,
    measure_escape,
    measure_stationary,
    worst,
)
from otwarp.bench.integrators.result import IntegratorsBench, Line, Point
from otwarp.bench.integrators.table import (
    SUMMARY_HEAD,
    VARIANTS_HEAD,
    error_cell,
    error_head,
    error_rows,
    summary_rows,
    variant_rows,
)
from otwarp.bench.integrators.wells import DEEP, SHALLOW, SplinedForce, Well
from otwarp.bench.report import NOTHING
from otwarp.bench.timing import Quartiles
from otwarp.errors import InputError
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.optics import Beam, Particle, force
from otwarp.simulation.model import Model
from otwarp.simulation.simulation import Simulation

BEAM = Beam(numerical_aperture=1.2)
SPHERE = Particle(radius=0.5, index=1.59)
SIGMAS = 5.0


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OTWARP_CACHE", str(tmp_path_factory.mktemp("tables")))
        yield


@pytest.fixture(scope="module")
def wells(device) -> tuple[Well, Well]:
    return Well.of_depth(BEAM, SPHERE, DEEP), Well.of_depth(BEAM, SPHERE, SHALLOW)


@pytest.fixture(scope="module")
def measured(device) -> IntegratorsBench:
    said: list[str] = []
    out = bench_integrators(
        BEAM,
        SPHERE,
        axes=["precision"],
        device=device,
        worlds=32,
        seconds=0.02,
        rounds=2,
        steps=(10, 4),
        call=1e-3,
        note=said.append,
    )
    assert {"wells", "Fokker–Planck equation", "Heun: timing", "float32: building", "Heun: z = 0.25"} <= set(said)
    return out


def check_agrees(found: Mean, exact: float, bias: float = 0.0) -> None:
    assert found.error > 0.0
    assert abs(found.value - exact) < SIGMAS * found.error + bias


def test_functions_of_means_have_the_right_errors():
    """The variance of samples has the standard error σ²√(2/n), and a ratio of independent means the usual one."""
    rng = np.random.default_rng(1)
    x, y = rng.normal(1.0, 2.0, (2, 40_000))
    found = from_means(lambda m: np.array([m[1] - m[0] ** 2, m[2] / m[0]]), np.stack([x, x**2, 3.0 + y], axis=1))
    check_agrees(found[0], 4.0)
    assert found[0].error == pytest.approx(4.0 * math.sqrt(2.0 / 40_000), rel=0.05)
    check_agrees(found[1], 4.0)
    assert found[1].error == pytest.approx(math.hypot(2.0, 4.0 * 2.0) / 200.0, rel=0.05)


def test_escape_times_that_were_not_seen():
    """A delay and then a constant rate; the error is near 1/√n of the mean though a fifth was not seen."""
    rng = np.random.default_rng(2)
    times = rng.uniform(0.0, 0.2, 20_000) + rng.exponential(0.9, 20_000)
    found = escape_mean(times, 0.5, 1.5)
    check_agrees(found, 1.0)
    assert 0.9 < found.error * math.sqrt(20_000) < 1.2
    cut = escape_mean(np.where(times > 1.5, np.inf, times), 0.5, 1.5)
    assert cut == found
    assert math.isnan(escape_mean(np.full(10, np.inf), 0.5, 1.5).value)


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0])
def test_the_step_of_one_per_cent(order):
    """Found between the steps, from errors of two orders, whatever the sign; noise widens the interval."""
    z = np.array([0.01, 0.02, 0.05, 0.1, 0.2, 0.3])
    a = -0.01 / 0.04**order
    found = largest_step(z, a * z**order, np.full(6, 1e-5), order=order, wanted=0.01)
    assert found.product == pytest.approx(0.04, rel=0.01) and not found.beyond
    assert found.low <= found.product <= found.high
    rng = np.random.default_rng(3)
    noisy = largest_step(z, a * z**order + 2e-3 * rng.standard_normal(6), np.full(6, 2e-3), order=order, wanted=0.01)
    assert noisy.high - noisy.low > found.high - found.low
    none = largest_step(z, 1e-3 * z**order, np.full(6, 1e-5), order=order, wanted=0.01)
    assert none == StepLimit(0.3, 0.3, 0.3, beyond=True)


def test_a_panel_is_as_good_as_its_worst():
    small, large, unsure = Mean(0.01, 0.001), Mean(-0.02, 0.001), Mean(0.05, 0.04)
    assert worst({"rho2": small, "z2": large}, "variance") == large
    assert worst({"rho2": small, "z2": unsure}, "variance") == small
    assert worst({"rho2": unsure, "z2": Mean(0.0, 0.01)}, "variance") == unsure
    assert worst({"rho2": small}, "variance") is None
    assert worst({"escape": Mean(math.nan, math.nan)}, "escape") is None


@pytest.mark.parametrize("name", ["eulerMaruyama", "heun"])
def test_a_spring_has_the_integrators_own_averages(name, device, wells):
    """Variance and decay of the chain x' = decay·x + noise: relative standard errors near 1 %."""
    well, steps, worlds = wells[0], 5, 500
    scheme, stiffness = INTEGRATORS[name], well.bead.properties.stiffness
    scene, dt = well.bead.scene(rung("harmonic")), well.relaxation / steps
    sim = Simulation(scene, worlds=worlds, device=device, time_step=dt, integrator=name, seed=5, allow_large_step=True)
    lags = well.lags
    start = well.start(worlds)
    found = measure_stationary(sim, well.bead.centre, start, window=steps, lags=lags, seconds=0.5)
    across, along = 1.0 / steps, stiffness[2] / max(stiffness) / steps
    check_agrees(found["rho2"], 2.0 * scheme.variance(across) * well.bead.spread[0] ** 2)
    check_agrees(found["z2"], scheme.variance(along) * well.bead.spread[2] ** 2)
    check_agrees(found["x_later"], scheme.decay(across) ** steps)
    check_agrees(found["z_half_later"], scheme.decay(along) ** (lags[1] * steps))
    check_agrees(found["z_later"], scheme.decay(along) ** (lags[2] * steps))


def springs(well: Well):
    """The harmonic rung's force at points from the equilibrium."""
    stiffness = np.array(well.bead.properties.stiffness)
    return lambda points: -stiffness * points


def test_beads_leave_a_spring_as_the_equation_says(device):
    """Kramers' problem in an ellipsoidal well that ends at a sphere: standard error 3 %, bias of the step 2 %."""
    well = Well.of_depth(BEAM, SPHERE, SHALLOW)
    expected = well.escape(springs(well), well.bead.region)
    assert expected.error < 2e-3 * expected.value
    scene, dt = well.bead.scene(rung("harmonic")), well.relaxation / 10
    sim = Simulation(scene, worlds=1000, device=device, time_step=dt, seed=6, allow_large_step=True)
    found = measure_escape(sim, expected.value)
    assert found.error < 0.04 * expected.value
    check_agrees(found, expected.value, bias=0.02 * expected.value)


def test_without_crossings_nobody_escapes_earlier(device):
    """The paths are the same; who is caught between two steps is caught later, or at last at the end of one."""
    well = Well.of_depth(BEAM, SPHERE, SHALLOW)
    scene, dt = well.bead.scene(rung("harmonic")), well.relaxation / 5
    escapes = []
    for crossings in (True, False):
        how = {"time_step": dt, "allow_large_step": True, "crossings": crossings}
        sim = Simulation(scene, worlds=300, device=device, seed=7, **how)
        assert sim.model.features.crossings == crossings
        sim.step(20_000)
        escapes.append(sim.readout.escape_step.numpy()[:, 0].copy())
    never = np.iinfo(np.int64).max
    seen, plain = (np.where(e < 0, never, e) for e in escapes)
    assert np.all(seen <= plain) and np.mean(seen < plain) > 0.02
    assert np.mean(seen < never) > 0.2


def test_references_are_right_to_a_thousandth(wells, device):
    """By what halving the cells changes."""
    model = Model.build(wells[1].bead.scene(rung(MODELS[2])), device=device)
    found = references(*wells, model, exact=False)
    assert set(found) == {"table"} and set(found["table"]) == set(OBSERVABLES)
    for estimate in found["table"].values():
        assert 0.0 < estimate.error < 1e-3 * estimate.value


@pytest.mark.validate
def test_a_table_is_as_good_as_exact_forces(wells, device):
    """A table of 1e-3 moves no average by more than some 1e-3."""
    model = Model.build(wells[1].bead.scene(rung(MODELS[2])), device=device)
    found = references(*wells, model, exact=True)
    for name in OBSERVABLES:
        assert found["table"][name].value == pytest.approx(found["exact"][name].value, rel=5e-3)


def test_exact_forces_by_spline(device):
    spline = SplinedForce(BEAM, SPHERE, 1.5, device)
    rng = np.random.default_rng(4)
    rho, z = rng.uniform(0.0, 1.0, 40), rng.uniform(-1.0, 1.0, 40)
    points = np.stack([rho, 0.0 * rho, z], axis=1)
    exact = force(BEAM, SPHERE, points)
    assert np.abs(spline(points) - exact).max() < 1e-4 * np.abs(exact).max()


def test_cases():
    names = [c.name for c in all_cases((), fast_math=False)]
    assert names[:2] == ["eulerMaruyama", PLAIN] and set(MODELS) <= set(names)
    assert [n for n in names if n in INTEGRATORS] == list(INTEGRATORS)
    assert names[-2:] == ["float32", "float32, fast_math"] or names[-1] == "float64"
    assert len(set(names)) == len(names)
    only = all_cases(["force"], fast_math=True)
    assert [c.name for c in only] == [DEFAULT, *MODELS] and all(c.settings["fast_math"] for c in only)
    plain = next(c for c in all_cases(["integrator"], fast_math=False) if c.name == PLAIN)
    assert not plain.sees_crossings and plain.settings["integrator"] == "eulerMaruyama"


def test_a_tiny_benchmark(measured):
    assert [line.name for line in measured.lines][:3] == [DEFAULT, "float32", "float32, fast_math"]
    line = measured.line(DEFAULT)
    assert [p.product for p in line.points] == [0.1, 0.25]
    for point in line.points:
        assert set(point.errors) == set(OBSERVABLES)
        for found in point.errors.values():
            # 32 beads know little, but not nothing
            assert abs(found.value) < 6.0 * found.error + 0.3
    assert set(line.limits) == set(PANELS) and line.cost.median > 0.0
    assert measured.worlds == 32 and measured.rounds == 2
    single = measured.line("float32")
    assert len(single.points) == 1 and single.points[0].product <= measured.default_product and not single.limits
    deep, shallow = measured.powers
    assert deep / shallow == pytest.approx(DEEP / SHALLOW)


def test_json_comes_back_as_it_was(measured, tmp_path: Path):
    file = tmp_path / "bench.json"
    unseen = replace(
        measured.lines[1], points=(Point(product=0.1, errors={"escape": Mean(math.nan, math.nan)}),), limits={}
    )
    other = replace(measured, lines=(measured.lines[0], unseen))
    other.save(file)
    back = IntegratorsBench.read(file)
    assert back.lines[0] == other.lines[0] and math.isnan(back.lines[1].points[0].errors["escape"].value)
    assert replace(back, lines=other.lines) == other
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data.pop("lines"),
        lambda data: data.update(version=99),
        lambda data: data.update(default="midpoint"),
        lambda data: data["lines"][0]["cost"].update(median=-1.0),
        lambda data: data["lines"][0]["points"][0].update(product=0.0),
        lambda data: data["lines"][0]["points"][0]["errors"].update(charm={"value": 0.0, "error": 0.0}),
        lambda data: data["lines"][0]["limits"].update(charm={}),
        lambda data: data["beam"].pop("kind"),
    ],
)
def test_a_foreign_file_is_refused(measured, tmp_path: Path, change):
    data = json.loads(json.dumps(measured.json()))
    change(data)
    file = tmp_path / "other.json"
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"other\.json is not what --out writes"):
        IntegratorsBench.read(file)


def made_up(name: str, cost: float, slope: float, order: int) -> Line:
    """Errors slope·z^order of all observables, seen to 0.1 %."""
    points = tuple(
        Point(product=z, errors={o: Mean(slope * z**order, 1e-3) for o in OBSERVABLES}) for z in (0.02, 0.1, 0.3)
    )
    case = next(c for c in all_cases(["integrator"], fast_math=False) if c.name == name)
    spread = Quartiles(cost, cost, cost)
    return Line(
        name=name,
        label=case.label,
        group="integrator",
        cost=spread,
        ratio=spread.times(0.5),
        points=points,
        limits=limits(points, replace(case, order=float(order))),
    )


def test_time_to_one_per_cent(measured):
    """Half as long a step at half the cost is no gain."""
    euler, heun = made_up("eulerMaruyama", 20.0, 0.5, 1), made_up("heun", 40.0, 0.25, 2)
    assert euler.time_to()[0] == pytest.approx(20.0 / 0.02, rel=0.05)
    assert heun.time_to("escape")[0] == pytest.approx(40.0 / 0.2, rel=0.05)
    bench = replace(measured, lines=(euler, heun))
    rows = summary_rows(bench)
    assert [len(row) for row in rows] == [len(SUMMARY_HEAD)] * 2 and "default" in rows[1][0]
    assert float(rows[1][-2].split()[0]) == pytest.approx(5.0, rel=0.1) and rows[1][-1] == NOTHING
    assert error_head(bench) == ("error [%]", "z = 0.02", "z = 0.1", "z = 0.3")
    cells = error_rows(bench)
    assert len(cells) == 6 and cells[0][1] == "+1.00 ± 0.1" and cells[1][1] == "< 0.2"
    assert error_at(heun, "variance", 0.1) == pytest.approx(0.0025)
    assert error_at(heun, "variance", 1.0) is None


def test_the_tables_and_the_page(measured):
    assert all(len(row) == len(VARIANTS_HEAD) for row in variant_rows(measured))
    assert error_cell(None) == error_cell(Mean(math.nan, math.nan)) == NOTHING
    assert error_cell(Mean(-0.0123, 0.001)) == "-1.23 ± 0.1"
    titles = [table.title for table in section.page_tables(measured)]
    assert titles[0] == "Time to 1 %" and len(titles) == 3
    page = (PAGES / "integrators.md").read_text()
    for kind in ("cpu", "cuda"):
        assert page.count(f"<!-- begin integrators {kind} -->") == page.count(f"<!-- end integrators {kind} -->") == 1


def test_the_section_goes_on_the_page(device):
    found = section.measure(
        device, axes=["precision"], sphere=SPHERE, rounds=1, worlds=16, seconds=0.01, steps=(4, 3), call=1e-3
    )
    text = found.markdown()
    assert "| Heun, default |" in text and "| float32 |" in text and section.HOW_TO_READ in text
    assert IntegratorsBench.from_json(found.data["integrators"]).worlds == 16
    assert text in put_on_page((PAGES / "integrators.md").read_text(), found)


def test_runs_of_two_devices_share_a_picture(measured, tmp_path: Path):
    lines = (made_up("eulerMaruyama", 20.0, 0.5, 1), made_up("heun", 40.0, 0.25, 2))
    run = replace(measured, lines=(*lines, *measured.lines[1:]))
    other = replace(run, kind="cuda", hardware="a faster one")
    alone, both = tmp_path / "alone.png", tmp_path / "both.png"
    draw_integrators([run], alone)
    draw_integrators([run, other], both)
    assert alone.read_bytes().startswith(b"\x89PNG") and alone.read_bytes() != both.read_bytes()
    assert set(tmp_path.iterdir()) == {alone, both}
    with pytest.raises(InputError, match=r"absent/x\.png"):
        draw_integrators([run], tmp_path / "absent" / "x.png")


def test_relative_errors():
    found = relative(Mean(1.02, 0.003), Estimate(1.0, 0.004))
    assert found.value == pytest.approx(0.02) and found.error == pytest.approx(0.005)
    assert set(STATIONARY) | {"escape"} == set(OBSERVABLES)


@pytest.mark.parametrize(
    ("beam", "options", "words"),
    [
        (BEAM, {"axes": ["colour"]}, "--axis is 'colour'; allowed: integrator, force, precision"),
        (BEAM, {"worlds": 1}, "--worlds is 1"),
        (BEAM, {"rounds": 0}, "--rounds is 0"),
        (BEAM, {"seconds": 0.0}, "--seconds is 0"),
        (BEAM, {"seconds": math.nan}, "--seconds is nan"),
        (replace(BEAM, polarization="x"), {}, "--polarization is 'x'.*allowed: circular, left"),
        (BEAM.with_power(0.0), {}, "--power is 0 mW"),
    ],
)
def test_bad_input(beam, options, words):
    with pytest.raises(InputError, match=words) as caught:
        bench_integrators(beam, SPHERE, device="cpu", **options)
    assert "\n" not in str(caught.value)
