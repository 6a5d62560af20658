"""Force models against run time: tiny worlds, real measurements, no claim about speed."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from otwarp.bench.forces.figure import draw_runs, pareto_front
from otwarp.bench.forces.measure import Probes, bench_forces
from otwarp.bench.forces.result import ForcesBench
from otwarp.bench.forces.table import HEAD, caption, table
from otwarp.bench.report import NOTHING
from otwarp.bench.rungs import HARMONIC, LADDER, RELAXATION, TrappedBead, chosen_rungs
from otwarp.bench.timed_rung import TimedRung
from otwarp.bench.timing import Quartiles
from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.optics import Beam, Particle, build_table, force
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions

BEAM = Beam(numerical_aperture=1.2, power=20.0)
SPHERE = Particle(radius=0.5, index=1.59)
MODELS = ("none", "bilinear-1e-2")
SINGLE = 2e-6
"""Forces of the float32 kernel over the peak: a few hundred roundings of 6e-8 at worst, one in the mean."""


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OTWARP_CACHE", str(tmp_path_factory.mktemp("tables")))
        yield


@pytest.fixture(scope="module")
def bead() -> TrappedBead:
    return TrappedBead(BEAM, SPHERE)


@pytest.fixture(scope="module")
def found(cache, device) -> ForcesBench:
    said: list[str] = []
    out = bench_forces(
        BEAM,
        SPHERE,
        models=MODELS,
        device=device,
        worlds=16,
        rounds=2,
        seconds=1e-3,
        probes=(100, 40),
        note=said.append,
    )
    assert {"exact forces", "no trap: building", "bilinear table 1e-2: measuring"} <= set(said)
    return out


def test_rows_are_those_asked_for_and_the_harmonic_one(found):
    assert [row.name for row in found.rows] == ["none", HARMONIC, "bilinear-1e-2"]
    assert found.worlds == 16 and found.rounds == 2
    for row in found.rows:
        assert 0.0 < row.cost.low <= row.cost.median <= row.cost.high
        assert row.rate.median == pytest.approx(1e9 / row.cost.median) and row.rate.low <= row.rate.high
        assert row.steps >= 1


def test_errors_are_those_of_the_models(found, bead):
    assert found.row("none").errors is None
    table = build_table(BEAM, SPHERE, tolerance=1e-2)
    assert found.peak == pytest.approx(BEAM.force_scale * table.peak)
    assert found.row("bilinear-1e-2").table_bytes == table.size
    tabulated, harmonic = found.row("bilinear-1e-2").errors, found.row(HARMONIC).errors
    assert tabulated is not None and harmonic is not None
    for errors in (tabulated, harmonic):
        assert 0.0 < errors.rms < errors.largest and 0.0 < errors.thermal_rms < errors.thermal_largest
    assert tabulated.largest <= 1e-2
    # the same model in float64, evaluated here
    probes = Probes.draw(bead, region=100, thermal=40)
    scale = BEAM.force_scale / found.peak
    twin = np.linalg.norm(
        table.force(probes.region.astype(float)) * scale - probes.exact_region / found.peak, axis=1
    ).max()
    assert tabulated.largest == pytest.approx(twin, abs=SINGLE)
    away = probes.thermal - bead.centre
    spring = -np.array(bead.properties.stiffness) * away
    twin = np.linalg.norm(spring - probes.exact_thermal, axis=1).max() / found.peak
    assert harmonic.thermal_largest == pytest.approx(twin, abs=SINGLE)


def test_forces_are_read_for_more_points_than_worlds(bead, device):
    probes = Probes.draw(bead, region=11, thermal=4)
    rung = chosen_rungs(())[1]
    runner = TimedRung(bead, rung, pick_device(device), worlds=4, time_step=bead.time_step, seconds=1e-3)
    got = runner.force_at(probes.region)
    expected = -np.array(bead.properties.stiffness) * (probes.region - bead.centre)
    assert got == pytest.approx(expected, abs=SINGLE * probes.peak)
    runner.rewind()
    start = runner.sim.state.position.numpy()[:, 0]
    assert np.all(np.linalg.norm(start - bead.centre, axis=1) < bead.region)
    assert len(np.unique(start, axis=0)) == 4


def test_a_table_is_built_once(cache, device, tmp_path, monkeypatch):
    bead = TrappedBead(BEAM, SPHERE)
    rung = next(r for r in LADDER if r.name == "bilinear-1e-2")
    monkeypatch.setenv("OTWARP_CACHE", str(tmp_path))
    first, second = (
        TimedRung(bead, rung, pick_device(device), worlds=2, time_step=bead.time_step, seconds=1e-3) for _ in range(2)
    )
    assert first.build_seconds is not None and first.build_seconds > 0.0
    assert second.build_seconds is None
    assert len(list(tmp_path.glob("*.npz"))) == 1


def test_probes_lie_where_they_should(bead):
    rng = np.random.default_rng(3)
    thermal = bead.thermal_points(4000, rng) - bead.centre
    # 5 standard errors of a variance from 4000 samples
    assert thermal.var(axis=0) == pytest.approx(bead.spread**2, rel=5.0 * math.sqrt(2.0 / 4000))
    probes = Probes.draw(bead, region=2000, thermal=2)
    distance = np.linalg.norm(probes.region - bead.centre, axis=1)
    assert distance.max() < bead.region * (1.0 + 1e-6)
    # evenly in the ball: half of its volume lies within 2^(-1/3) of its radius; 5 standard errors
    assert abs(np.mean(distance < 0.5 ** (1.0 / 3.0) * bead.region) - 0.5) < 5.0 * 0.5 / math.sqrt(2000)
    assert bead.energy / bead.spread**2 == pytest.approx(np.array(bead.properties.stiffness))


@pytest.mark.parametrize(
    "rung", [r for r in LADDER if r.tolerance is None and r.family != "exact"], ids=lambda r: r.name
)
def test_scenes_differ_in_the_force_model_alone(rung, bead):
    model = Model.build(bead.scene(rung), device="cpu", options=StepOptions(time_step=bead.time_step))
    features = model.features
    assert features.driver == "solo" and features.brownian and features.bodies == 1
    terms = {
        "none": (),
        "harmonic": ("harmonic_split",),
        "isotropic": ("piecewise_isotropic",),
        "split": ("piecewise_split",),
    }
    assert features.trap_models == terms[rung.family]
    # every rung with a trap watches for escapes, so that the rows differ in the force alone
    assert features.escapes == (rung.family != "none")
    assert model.start_position()[0] == pytest.approx(bead.centre)
    if rung.family == "harmonic":
        rate = max(bead.properties.stiffness) * bead.time_step / RELAXATION
        assert rate == pytest.approx(6.0 * math.pi * model.scene.medium.viscosity * SPHERE.radius)


def test_the_exact_model_is_exact_in_a_scene(bead, device):
    rung = next(r for r in LADDER if r.family == "exact")
    runner = TimedRung(bead, rung, pick_device(device), worlds=8, time_step=bead.time_step, seconds=1e-3)
    assert all(name.startswith("exact") for name in runner.sim.model.features.trap_models)
    errors = Probes.draw(bead, region=20, thermal=5).errors(runner.force_at)
    assert errors.largest < SINGLE and runner.build_seconds is None


def test_the_region_ends_where_the_trap_first_lets_go(bead):
    assert bead.region == min(bead.properties.escape_distance)
    out = bead.centre + np.array([[0.5 * bead.region, 0.0, 0.0], [0.0, 0.0, 0.5 * bead.region]])
    pull = force(BEAM, SPHERE, out)
    assert pull[0, 0] < 0.0 and pull[1, 2] < 0.0


def test_json_comes_back_as_it_was(found, tmp_path: Path):
    file = tmp_path / "bench.json"
    found.save(file)
    assert ForcesBench.read(file) == found
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data.pop("rows"),
        lambda data: data.update(version=99),
        lambda data: data["rows"][0]["cost"].update(median=-1.0),
        lambda data: data["beam"].pop("power"),
        lambda data: data.update(surprise=1),
    ],
)
def test_a_foreign_file_is_refused(found, tmp_path: Path, change):
    data = json.loads(json.dumps(found.json()))
    change(data)
    file = tmp_path / "other.json"
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"other\.json is not what --out writes"):
        ForcesBench.read(file)


def test_pareto_front():
    assert pareto_front([(3.0, 1.0), (1.0, 5.0), (2.0, 6.0), (4.0, 1.0), (2.5, 2.0)]) == [
        (1.0, 5.0),
        (2.5, 2.0),
        (3.0, 1.0),
    ]


def test_runs_of_two_devices_share_a_picture(found, tmp_path: Path):
    other = replace(
        found,
        kind="cuda",
        hardware="a faster one",
        rows=tuple(replace(row, cost=row.cost.times(1e-3)) for row in found.rows),
    )
    alone, both = tmp_path / "alone.png", tmp_path / "both.png"
    draw_runs([found], alone)
    draw_runs([found, other], both)
    assert alone.read_bytes().startswith(b"\x89PNG") and alone.read_bytes() != both.read_bytes()
    assert set(tmp_path.iterdir()) == {alone, both}
    with pytest.raises(InputError, match=r"absent/x\.png"):
        draw_runs([found], tmp_path / "absent" / "x.png")


def test_the_table_says_what_was_found(found):
    rows = table(found, "").rows
    assert all(len(row) == len(HEAD) for row in rows)
    assert rows[0][0] == "no trap" and rows[0][4:] == (NOTHING,) * 5
    slow = replace(
        found.rows[2], cost=Quartiles(100.0, 80.0, 125.0), ratio=Quartiles(2.0, 1.5, 2.5), build_seconds=0.512
    )
    cells = table(replace(found, rows=(slow,)), "").rows[0]
    assert cells[1:4] == ("10 (8 – 12.5)", "100", "2 (1.5 – 2.5)") and cells[8] == "0.51"
    for words in ("16 beads", "r = 0.5 µm", "20 mW", "100 random points"):
        assert words in caption(found)


@pytest.mark.parametrize(
    ("beam", "sphere", "options", "words"),
    [
        (BEAM, SPHERE, {"models": ["cubic"]}, "--model is 'cubic'; allowed: none, harmonic"),
        (BEAM, SPHERE, {"worlds": 0}, "--worlds is 0"),
        (BEAM, SPHERE, {"rounds": 0}, "--rounds is 0"),
        (BEAM, SPHERE, {"models": ["none"], "time_step": 0.0}, "time step is 0 s"),
        (BEAM, Particle(radius=0.5, index=1.59 + 0.01j), {}, "--index"),
        (BEAM.with_power(0.0), SPHERE, {}, "--power is 0 mW"),
        (BEAM.with_power(0.01), SPHERE, {}, "--power is 0.01 mW: the trap is .* from"),
        (BEAM, Particle(radius=0.5, index=1.2), {}, "no stable point|sideways|along the axis of this beam only"),
    ],
)
def test_bad_input(beam, sphere, options, words):
    with pytest.raises(InputError, match=words) as caught:
        bench_forces(beam, sphere, device="cpu", probes=(2, 2), seconds=1e-3, **options)
    assert "\n" not in str(caught.value)
