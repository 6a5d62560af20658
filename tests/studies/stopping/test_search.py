"""Where trials go: to a contour, or to the largest value along an axis; both are held as often as is said."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import expit

from otwarp.bench.integrators.fokker_planck import survival_probability
from otwarp.errors import InputError
from otwarp.hydrodynamics.bispherical import wall_resistance
from otwarp.studies.axes import grid, values
from otwarp.studies.file import load_study
from otwarp.studies.observables import first_passage, trapped
from otwarp.studies.stopping.contour import contour
from otwarp.studies.stopping.intervals import interval
from otwarp.studies.stopping.rules import half_width
from otwarp.studies.stopping.search import largest, stop_of
from otwarp.studies.study import Study
from otwarp.units import BOLTZMANN
from tests.studies.scenes import bead_in_a_well

pytest.importorskip("zarr")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


def filled(rule, chances, random, *, common):
    """Counts and trials of rows of points with these chances, given trials until the rule is content."""
    rows, length = chances.shape
    shape = (rows, 1 if common else length, rule.at_most)
    sums = np.cumsum(random.random(shape, dtype=np.float32) < chances[..., None], axis=-1).reshape(-1, rule.at_most)
    done = np.zeros(rows * length, dtype=int)
    while True:
        k = np.where(done > 0, np.take_along_axis(sums, np.maximum(done, 1)[:, None] - 1, 1)[:, 0], 0)
        wanted = rule.wanted(k[None], done, length)
        if np.all(wanted <= done):
            return k.reshape(rows, length), done.reshape(rows, length)
        done = wanted


@pytest.mark.parametrize("common", [True, False])
def test_the_largest_value_is_covered(common):
    """Of 400 searches on a logistic curve, with common random numbers and without, 95 % hold the limit, within 5σ."""
    count, x = 400, np.linspace(0.0, 4.0, 65)
    rule = largest(0.9, along="x", trials=128)
    chances = np.broadcast_to(expit(-4.0 * (x - 2.5)), (count, 65))
    right = 2.5 - np.log(9.0) / 4.0
    k, n = filled(rule, chances, np.random.Generator(np.random.Philox(3)), common=common)
    low, high = interval(k, n, level=rule.level)
    known = n > 0
    sure = np.where(known & (low >= 0.9), x, -1.0).max(axis=1)
    never = np.where(known & (high < 0.9), x, 9.0).min(axis=1)
    assert np.mean((sure <= right) & (right <= never)) >= 0.95 - 5.0 * np.sqrt(0.95 * 0.05 / count)
    assert known.sum(axis=1).max() <= rule.range_of((count, 65))[1] / count / 128
    assert np.median(never - sure) < 0.6


@pytest.mark.parametrize("method", ["looks", "sequence"])
@pytest.mark.parametrize("apart", [0.0, 0.01, 0.05, 0.2])
def test_a_contour_is_covered(apart, method):
    """Points that stop when they are surely off the contour hold their chance in 95 % of 1,000 cases, within 5σ."""
    count = 1_000
    rule = contour(0.5, half_width=0.06, at_least=16, at_most=4_096, method=method)
    k, n = filled(rule, np.full((count, 1), 0.5 + apart), np.random.Generator(np.random.Philox(7)), common=False)
    low, high = (end[0].reshape(n.shape) for end in rule.interval(k.reshape(1, -1), n.ravel()))
    held = np.mean((low <= 0.5 + apart) & (0.5 + apart <= high))
    assert held >= 0.95 - 5.0 * np.sqrt(0.95 * 0.05 / count)
    assert np.all((0.5 * (high - low) <= 0.06) | (low > 0.5) | (high < 0.5))
    assert apart < 0.2 or np.median(n) < 120


@pytest.mark.parametrize("points", [8, 32])
def test_a_contour_costs_less_than_the_same_width_everywhere(points):
    """On a map whose P falls from 0.9 to 0.1 over a quarter of its side: less than half of the trials."""
    x = np.linspace(-0.5, 0.5, points)
    chances = expit((np.hypot(x[:, None], x) - 0.3) / 0.06)
    random = np.random.Generator(np.random.Philox(9))
    rules = half_width(0.05), contour(0.5, half_width=0.05)
    taken = [filled(rule, chances, random, common=False)[1] for rule in rules]
    assert 2 * taken[1].sum() < taken[0].sum()
    beside = np.abs(chances - 0.5) < 0.02
    assert not beside.any() or taken[1][beside].mean() > 0.9 * taken[0][beside].mean()


@pytest.mark.thorough
def test_a_study_searches_and_gives_a_table(tmp_path, scene):
    """The farthest start from which 75 % are held for 0.1 s, against the backward Fokker–Planck equation."""
    fine = bead_in_a_well(scene.parent, accuracy=0.005)
    study = Study(
        fine,
        axes={"start.x:/World/bead": grid(0.0, 0.4, 65, unit="µm"), "trap_power": values([0.6, 1.0], unit="mW")},
        observables=[trapped(until=0.1), first_passage()],
        stop=largest(0.75, along="start.x:/World/bead", trials=512),
        seed=5,
    )
    assert study.design.shape == (2, 65) and len(study.blocks()) == 2
    found = study.run(tmp_path / "out", devices=["cpu"])
    assert found["largest"].dims == ("trap_power",) and found["largest"].attrs["units"] == "µm"
    assert np.all(found["largest_low"] <= found["largest"]) and np.all(found["largest"] <= found["largest_high"])
    assert np.sum(found["trials"] > 0) <= 36
    medium = study.design.scene.medium
    energy = BOLTZMANN * medium.temperature
    diffusion = energy / (6.0 * np.pi * medium.viscosity * 0.5)
    places = np.array([float(v) for end in ("low", "high") for v in found[f"largest_{end}"]])
    for n, power in enumerate((0.6, 1.0)):
        ends = survival_probability(
            lambda place, k=0.5 * power: -k * place, 0.4, np.sort(places[n::2]), 0.1, diffusion=diffusion, energy=energy
        )
        assert ends[0].value >= 0.75 - 0.01 and ends[1].value <= 0.75 + 0.01
    again = study.compute([1], device="cpu", worlds=97)[0]
    assert np.array_equal(again["trials"][0], found["trials"][1])


def speeds_of(scene, power: float, speeds: np.ndarray, *, until: float, trials: int, probability: float = 0.95):
    """A study of the largest speed at which the trap keeps its bead."""
    return Study(
        scene,
        axes={
            "trap_power": values([power], unit="mW"),
            "speed:/World/trap": values(list(speeds), unit="µm/s"),
        },
        observables=[trapped(until=until)],
        stop=largest(probability, along="speed:/World/trap", trials=trials),
        seed=5,
    )


@pytest.mark.validate
@pytest.mark.parametrize("floor", [None, 1.0, 0.6])
def test_without_noise_the_largest_speed_is_the_largest_force_over_the_drag(tmp_path, floor):
    """A well that ends holds with k·rim at most: between neighbours 2 % apart, free, and above a plane it drags along.

    Drag beside the plane is that of the exact series in bispherical coordinates, at a radius of 0.5 µm 1.38 and 1.95 of
    Stokes'; the slowest bead takes e^{−30} of the rim longer than half a second to lag as far as it will.
    """
    scene = bead_in_a_well(tmp_path, speed=30.0, brownian=False, floor=floor)
    hindered = 1.0 if floor is None else wall_resistance(floor / 0.5 - 1.0).sliding
    limit = 0.5 * 0.4 / (6.0 * np.pi * 0.00089 * 0.5 * hindered)
    study = speeds_of(scene, 1.0, limit * np.linspace(0.9, 1.1, 11), until=0.5, trials=1, probability=0.5)
    assert float(study.run(tmp_path / "out", devices=["cpu"])["largest"].squeeze()) == pytest.approx(limit, rel=0.02)


@pytest.mark.validate
@pytest.mark.parametrize("power", [2.5, 10.0])
def test_with_noise_the_largest_speed_is_that_of_the_fokker_planck_equation(tmp_path, power):
    """The trap's frame: F = −k r − γ v ẑ. At the ends of the interval the exact chance is on either side of 95 %."""
    speed, until = 400.0, 0.1
    scene = bead_in_a_well(tmp_path, speed=speed, accuracy=0.005)
    k, drag, energy = 0.5 * power, 6.0 * np.pi * 0.00089 * 0.5, BOLTZMANN * 298.15
    limit = k * 0.4 / drag
    study = speeds_of(scene, power, limit * np.linspace(0.3, 1.0, 71), until=until, trials=2_048)
    found = study.run(tmp_path / "out", devices=["cpu"])
    held = []
    for end in ("low", "high"):
        pull = np.array([0.0, 0.0, drag * float(found[f"largest_{end}"].squeeze())])
        at = survival_probability(
            lambda r, pull=pull: -k * r - pull, 0.4, np.array([1e-3]), until, diffusion=energy / drag, energy=energy
        )[0]
        held.append(at.value)
        assert at.error < 0.005
    assert held[0] >= 0.95 - 0.01 and held[1] <= 0.95 + 0.01
    assert held[0] - held[1] < 0.1, "the interval must say something"
    assert float(found["largest_high"].squeeze()) < 0.95 * limit, "noise must matter"


@pytest.mark.thorough
def test_a_step_for_each_point(tmp_path, scene):
    """Weak traps take longer steps, which are stored; a study in one step agrees within its intervals."""

    def at(*powers, step):
        axes = {"trap_power": values(powers, unit="mW")}
        return Study(scene, axes=axes, observables=[trapped(until=0.02)], time_step=step)

    study = at(1.0, 20.0, step="per point")
    assert study.plan().longest_step > 1.9 * study.plan().time_step
    found = study.run(tmp_path / "each", devices=["cpu"])
    assert found["time_step"].values.tolist() == (0.02 / study.step_counts).tolist()
    alone = at(1.0, step=float(found["time_step"][0]))
    assert (
        alone.compute([0], device="cpu")[0]["end"].tolist() == study.compute([0], device="cpu")[0]["end"][:1].tolist()
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "allowed: one of trials, half_width, contour, largest"),
        ({"largest": 0.9}, "no along"),
        ({"largest": 1.9, "along": "x"}, "largest is 1.9"),
        ({"contour": [0.5, 2]}, "contour is"),
        ({"contour": 0.5, "along": "x"}, "contour has along"),
        ({"trials": "many"}, "trials is"),
    ],
)
def test_bad_rules(given, said):
    with pytest.raises(InputError, match=said):
        stop_of(given)


def test_a_search_needs_an_axis_and_a_probability(tmp_path, scene):
    axes = {"trap_power": values([1.0, 0.5], unit="mW")}
    for observables, along, said in (
        ([trapped(until=0.1)], "trap_powr", "along is 'trap_powr'; allowed: an axis of the study, trap_power"),
        ([trapped(until=0.1)], "trap_power", "do not rise"),
        ([first_passage()], "trap_power", "do not rise|needs one probability"),
    ):
        with pytest.raises(InputError, match=said):
            Study(scene, axes=axes, observables=observables, horizon=0.1, stop=largest(0.9, along=along))
    with pytest.raises(InputError, match="allowed: a time above 0 s, or 'per point'"):
        Study(scene, axes=axes, observables=[trapped(until=0.1)], time_step="per trial")
    (tmp_path / "s.toml").write_text(
        f'scene = "{scene}"\ntime_step = "per point"\n[[observable]]\nkind = "trapped"\nuntil = "0.1 s"\n'
        '[[axis]]\nname = "trap_power"\nvalues = [0.5, 1]\nunit = "mW"\n[stop]\nlargest = 0.9\nalong = "trap_power"\n'
    )
    assert load_study(tmp_path / "s.toml").stop == largest(0.9, along="trap_power")
