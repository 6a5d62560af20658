"""Axes of every kind: the values they say, the points they make, and what worlds start with; numbers of a trial."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import truncnorm

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Scene, SceneBuilder, Settings, Sphere, Track, Trap
from otwarp.studies.axes import Scatter, label, normal, random, sobol, spoken, together_of, values
from otwarp.studies.engines.run import run_study
from otwarp.studies.file import load_study
from otwarp.studies.observables import contact_dose, contact_force, orientation_error, trapped
from otwarp.studies.results import table
from otwarp.studies.rows import FARTHEST, normal_of, origin_of, start_rows
from otwarp.studies.stopping.rules import trials
from otwarp.studies.study import Study
from tests.simulation.setups import obstacle
from tests.studies.scenes import bead_in_a_well

pytest.importorskip("zarr")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


def study_of(scene, axes, **how) -> Study:
    return Study(scene, **({"observables": [trapped(until=0.002)], "stop": trials(2), "seed": 3} | how), axes=axes)


def test_random_and_normal_values():
    """Their distribution, within 5σ; the same for the same seed; vectors component by component."""
    drawn = random([0.0, 1.0, -2.0], [1.0, 3.0, 2.0], 4_000, unit="µm", seed=5)
    width = np.array([1.0, 2.0, 4.0])
    assert np.all(drawn.values >= [0, 1, -2]) and np.all(drawn.values < [1, 3, 2])
    assert np.all(np.abs(drawn.values.mean(axis=0) - [0.5, 2.0, 0.0]) < 5.0 * width / np.sqrt(12.0 * 4_000))
    assert np.array_equal(drawn.values, random([0.0, 1.0, -2.0], [1.0, 3.0, 2.0], 4_000, seed=5).values)
    assert not np.array_equal(drawn.values, random([0.0, 1.0, -2.0], [1.0, 3.0, 2.0], 4_000, seed=6).values)
    bell = normal(2.0, 0.25, 4_000, unit="µm", seed=5).values
    assert abs(bell.mean() - 2.0) < 5.0 * 0.25 / np.sqrt(4_000)
    assert abs(bell.std(ddof=1) - 0.25) < 5.0 * 0.25 / np.sqrt(8_000)


def test_names_of_axes_for_people():
    """As tables name them, and as pictures do."""
    named = {
        "trap_power": ("trap_power", "trap power"),
        "trap_power:/World/Traps/left_hub": ("trap_power_left_hub", "trap power of left hub"),
        "start.x:/World/bead": ("start_x_bead", "start x of bead"),
        "/World/cell.ot:cell:youngsModulus": ("cell_youngsModulus", "youngsModulus of cell"),
        "/World/bead/sphere.radius": ("sphere_radius", "radius of sphere"),
    }
    assert {name: (label(name), spoken(name)) for name in named} == named


def test_sobol_points_are_even():
    """A power of two of them: one in each of as many equal parts of every component; units go with components."""
    power, height = sobol([1.0, -2.0], [9.0, 2.0], 64, unit=["mW", "µm"], seed=7)
    for axis, low, high in ((power, 1.0, 9.0), (height, -2.0, 2.0)):
        parts = np.floor(64 * (axis.values - low) / (high - low)).astype(int)
        assert sorted(parts) == list(range(64))
    assert (power.unit, height.unit) == ("mW", "µm")
    (alone,) = sobol(1.0, 9.0, 64, unit=["mW"], seed=7)
    assert alone.unit == "mW" and np.array_equal(alone.values, sobol(1.0, 9.0, 64, unit="mW", seed=7).values)


@pytest.mark.parametrize(
    ("scatter", "said"),
    [
        (
            Scatter(30.0),
            "trap_power, up to 4 deviations of its scatter off, has the value -0.2; allowed: in .0, 10000. mW",
        ),
        (Scatter(0.3, "mW"), "trap_power, up to 4 deviations of its scatter off, has the value -0.2"),
        (Scatter(0.1, "µm"), "scatter of trap_power has the unit 'µm'; allowed: mW, or another unit of the same kind"),
    ],
)
@pytest.mark.parametrize("own", [True, False])
def test_scatter_that_no_trial_can_have(scene, scatter, said, own):
    """Found out when the study is planned, whether the parameter is an axis or the scene's own, 1 mW."""
    axes = {"trap_power": values([1.0, 2.0], unit="mW")} if own else {}
    with pytest.raises(InputError, match=said):
        study_of(scene, axes, scatter={"trap_power": scatter}).plan()


def test_scattered_numbers_are_normal_within_their_bounds():
    """Moments of the normal distribution that is cut off at four deviations, at 5σ; none farther."""
    drawn, n = normal_of(3, 0, np.arange(100_000)), 100_000
    assert np.abs(drawn).max() < FARTHEST
    bell = truncnorm(-FARTHEST, FARTHEST)
    assert abs(drawn.mean()) < 5.0 * bell.std() / np.sqrt(n) and abs(drawn.var() / bell.var() - 1.0) < 5.0 * np.sqrt(
        2.0 / n
    )


def test_together_in_files_they_fill_the_box():
    """One Sobol sequence of several names, evenly in the plane of each two; random numbers that are not the same."""
    box = {"from": 0.0, "to": 1.0, "count": 64}
    cube = {"from": [0.0, 0.0, 0.0], "to": [1.0, 1.0, 1.0], "count": 64}
    power, start = together_of(
        [{"name": "trap_power", "sobol": box, "unit": "mW"}, {"name": "start:/a", "sobol": cube, "unit": "µm"}]
    )
    assert (power.unit, start.unit, start.values.shape) == ("mW", "µm", (64, 3))
    for k in range(3):
        cells = np.histogram2d(power.values, start.values[:, k], bins=4, range=[[0, 1], [0, 1]])[0]
        assert np.all(np.abs(cells - 4.0) <= 2.0)
    a, b = together_of([{"name": n, "random": box | {"count": 400}} for n in ("a", "b")])
    assert abs(np.corrcoef(a.values, b.values)[0, 1]) < 5.0 / np.sqrt(400)
    with pytest.raises(InputError, match="axes a, b: sobol has a count of its own for each"):
        together_of([{"name": "a", "sobol": box}, {"name": "b", "sobol": box | {"count": 32}}])


def test_axes_that_go_together(scene):
    """One dimension with as many points, in their own units or those of the targets."""
    names = ("trap_power", "start.x:/World/bead")
    study = study_of(scene, {names: (values([200, 400], unit="µW"), values([30, 60], unit="nm"))})
    at = {t.name: v.tolist() for t, v in study.design.at(np.arange(study.design.points)).items()}
    assert study.design.shape == (2,)
    assert at[names[0]] == pytest.approx([0.2, 0.4]) and at[names[1]] == pytest.approx([0.03, 0.06])
    drawn = study_of(scene, {names: sobol([0.2, 0.0], [1.0, 0.3], 8, unit=["mW", "µm"])})
    assert drawn.design.points == 8


def test_names_and_words_that_are_none_are_told_in_one_line(scene):
    radius = "/World/bead/sphere.radius"
    for axes, said in (
        ({radius: values(["a", "b"])}, f"{radius} = a: must be a value of type double"),
        ({"/World/bead": values([1.0], unit="µm")}, "/World/bead has no attribute (none); there are "),
        ({5: values([1.0])}, "axis (5,); allowed: a name, or a tuple of names"),
        ({(5, "trap_power"): (values([1.0]),) * 2}, "axis (5, 'trap_power'); allowed: a name, or a tuple of names"),
    ):
        with pytest.raises(InputError) as error:
            design = study_of(scene, axes).design
            design.scene_of(design.groups(np.arange(1))[0][1])
        assert said in str(error.value) and "\n" not in str(error.value)


def test_kinds_of_axes_run(scene, tmp_path):
    """From a file: random powers beside normal starts, and a dimension of vectors; the table has their values."""
    (tmp_path / "well.usda").write_text(scene.read_text())
    (tmp_path / "s.toml").write_text(
        'scene = "well.usda"\n[[axis]]\nname = "trap_power"\nrandom = { from = 0.2, to = 1, count = 3, seed = 4 }\n'
        'unit = "mW"\n[[axis]]\nname = "start:/World/bead"\n'
        "normal = { mean = [0, 0, 10], deviation = [0.05, 0.05, 0.05], count = 2, seed = 4 }\n"
        'unit = "µm"\n[[observable]]\nkind = "trapped"\nuntil = "2 ms"\n[stop]\ntrials = 4\n'
    )
    found = load_study(tmp_path / "s.toml").run(tmp_path / "out", devices=["cpu"])
    assert found["trapped"].shape == (3, 2) and np.all(found["trapped"] == 1.0)
    assert np.allclose(found["trap_power"], random(0.2, 1.0, 3, seed=4).values)
    drawn = normal([0, 0, 10], [0.05] * 3, 2, seed=4).values
    for n, letter in enumerate("xyz"):
        assert np.allclose(found[f"start_bead_{letter}"], drawn[:, n])


@pytest.mark.thorough
def test_bodies_start_turned(scene, tmp_path):
    """About axes of the world, on top of the scene's own orientation, about the origin of the prim."""
    folder = tmp_path
    own = Rotation.from_euler("x", 30, degrees=True)
    spheres = tuple(
        Sphere(prim=f"/World/pair/s{n}", offset=(x, 0.0, 0.0), radius=0.5, refractive_index=1.59)
        for n, x in enumerate((0.6, 1.8))
    )
    pair = Body(prim="/World/pair", position=(0.0, 0.0, 10.0), orientation=tuple(own.as_quat()), spheres=spheres)
    law = TrapLaw(stiffness=0.5, threshold=0.4, cutoff=0.4, power=1.0)
    place, power = Track.constant((0.6, 0.0, 10.0)), Track.constant(1.0)
    trap = Trap(prim="/World/trap", position=place, power=power, radial=law, holds="/World/pair/s0")
    builder = SceneBuilder(settings=Settings(duration=0.01))
    builder.add(pair)
    builder.add(trap)
    file = builder.save(folder / "pair.usda")
    wanted = orientation_error(**dict(zip("xyzw", own.as_quat().tolist(), strict=True)))
    study = study_of(
        file,
        {"turn.z:/World/pair": values([0.0, 5.0, 20.0], unit="deg")},
        observables=[trapped(until=1e-5), wanted],
        horizon=1e-5,
        time_step=1e-6,
        stop=trials(8),
    )
    at = study.design.at(np.arange(3))
    origin = origin_of(Scene.load(file), study.options)
    rows = start_rows(origin, at, 3)
    for n, angle in enumerate((0.0, 5.0, 20.0)):
        turned = Rotation.from_euler("z", angle, degrees=True) * own
        assert np.allclose(Rotation.from_quat(rows["orientation"][n, 0]).as_matrix(), turned.as_matrix())
        reference = np.array([0.0, 0.0, 10.0]) + turned.apply(origin.reference[0])
        assert np.allclose(rows["position"][n, 0], reference)
    found = table(run_study(study, folder / "out", devices=["cpu"]))
    # diffusion over 10 µs turns a pair by some hundredths
    assert np.allclose(found["orientation_error"], np.radians([0.0, 5.0, 20.0]), atol=0.05)
    assert found["orientation_error"].attrs["units"] == "rad"


@pytest.mark.thorough
def test_contact_force_and_dose(tmp_path):
    """A bead that its trap presses onto a floor, without noise: force balances force, and the dose is that over time.

    It rests 40 nm above the trap, less what Hertz's contact gives way (1 nm): F = k·40 nm; to which it comes in less
    than a hundredth of the time.
    """
    loaded = Scene.load(bead_in_a_well(tmp_path, brownian=False))
    builder = SceneBuilder(settings=loaded.settings)
    for item in (*loaded.bodies, *loaded.traps, obstacle("Floor", "plane", (0.0, 0.0, 9.54))):
        builder.add(item)
    pressed = builder.save(tmp_path / "pressed.usda")
    axes = {
        "start.z:/World/bead": values([10.04], unit="µm"),
        "trap_power": values([0.5, 1.0], unit="mW"),
    }
    asked = [contact_force, contact_dose(body=0)]
    study = study_of(pressed, axes, observables=asked, horizon=0.2, stop=trials(1), every=1e-3)
    found = table(run_study(study, tmp_path / "out", devices=["cpu"])).squeeze()
    assert found["contact_dose"].attrs["units"] == "pN·s" and found["contact_force"].attrs["units"] == "pN"
    wanted = 0.5 * found["trap_power"].values * 0.04
    assert found["contact_force"].values == pytest.approx(wanted, rel=0.05)
    assert found["contact_dose"].values == pytest.approx(0.2 * found["contact_force"].values, rel=0.02)
