"""What no study can be made of is refused in a line, before anything runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.studies.axes import Scatter, grid, normal, random, sobol, values
from otwarp.studies.engines.run import run_study
from otwarp.studies.observables import delivered, trapped
from otwarp.studies.stopping.rules import half_width, trials
from tests.studies.scenes import bead_in_a_well, study_of, study_of_a_well

pytest.importorskip("zarr")

ROOT = Path(__file__).parents[2]

FILE = study_of_a_well(6, 2_048)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        ({"trap_powr": grid(1, 2, 3, unit="mW")}, "did you mean trap_power"),
        ({"trap_power": grid(1, 2, 3)}, "allowed: mW"),
        ({"trap_power": grid(1, 2, 3, unit="µm")}, "unit 'µm'"),
        ({"trap_power": values([-1.0], unit="mW")}, "value -1"),
        ({"trap_power:/World/tarp": grid(1, 2, 3, unit="mW")}, "did you mean /World/trap"),
        ({"start:/World/bead": values([1.0], unit="µm")}, "three numbers each"),
        ({"start.q:/World/bead": values([1.0], unit="µm")}, "allowed: x, y, z"),
        ({("trap_power", "start.x:/World/bead"): (grid(1, 2, 3, unit="mW"), grid(1, 2, 4, unit="µm"))}, "lengths"),
        ({"/World/bead.raduis": values([1.0])}, "no attribute raduis"),
        ({"speed:/World/trap": values([1.0], unit="µm/s")}, "stands still"),
        ({"trap_power": "grid"}, "allowed: grid"),
        ({("trap_power", "trap_power"): (grid(1, 2, 3, unit="mW"),) * 2}, "axis trap_power stands there twice"),
    ],
)
def test_bad_axes(scene, axes, said):
    """Name, value and what is allowed."""
    with pytest.raises(InputError, match=said):
        study_of(scene, axes=axes)


def test_a_start_inside_an_obstacle():
    """Refused before anything runs; beside the pillar it is none of its business."""
    scene = ROOT / "scenes" / "cell_delivery.usda"
    for x, inside in ((-31.0, True), (-14.0, False)):
        axes = {"start:/World/cell": values([[-58.0, -26.0, 8.0], [x, -9.0, 8.0]], unit="µm")}
        if inside:
            with pytest.raises(InputError, match=r"start:/World/cell = .* overlap with /World/Obstacles/pillar_1"):
                study_of(scene, axes=axes)
        else:
            assert study_of(scene, axes=axes).design.points == 2


def test_a_start_inside_an_obstacle_beside_an_axis_that_turns():
    """A turn of some body, even of the cell itself, hides no start; a robot that is turned into a pillar is seen."""
    scene = ROOT / "scenes" / "cell_delivery.usda"
    start = {"start:/World/cell": values([[-58.0, -26.0, 8.0], [-31.0, -9.0, 8.0]], unit="µm")}
    for name in ("turn.z:/World/cell", "turn.z:/World/Robots/left"):
        with pytest.raises(InputError, match=rf"{name} = 0.1 rad: /World/cell: overlap with /World/Obstacles/pillar_1"):
            study_of(scene, axes=start | {name: values([0.1], unit="rad")})
    left = next(b for b in Scene.load(scene).bodies if b.prim == "/World/Robots/left")
    bearing = np.degrees(np.arctan2(*left.spheres[0].offset[1::-1]))  # of a handle, 5 µm from the middle
    place = values([[-31.0 - 12.5, -9.0, 10.0]], unit="µm")  # the pillar's radius is 8.5 µm
    free, inside = (values([angle], unit="deg") for angle in (180.0 - bearing, -bearing))
    with pytest.raises(InputError, match="/World/Robots/left: overlap with /World/Obstacles/pillar_1"):
        study_of(scene, axes={"start:/World/Robots/left": place, "turn.z:/World/Robots/left": inside})
    assert (
        study_of(scene, axes={"start:/World/Robots/left": place, "turn.z:/World/Robots/left": free}).design.points == 1
    )


@pytest.mark.quick
def test_times_that_are_none(scene):
    """A bool is no number; a number of NumPy and a text with its unit are."""
    wrongs: list[Any] = [True, False, np.True_, np.nan, -1, [1.0], "1", "1 mW"]
    for wrong in wrongs:
        for name in ("horizon", "every"):
            with pytest.raises(InputError, match=rf"^{name} (is|has) .*; allowed: "):
                study_of(scene, **{name: wrong})
        with pytest.raises(InputError, match=r"^until (is|has) .*; allowed: "):
            trapped(until=wrong)
    rights: list[Any] = [np.float32(2.0), np.int64(2), "2 s", "2000 ms"]
    for right in rights:
        assert study_of(scene, horizon=right).horizon == 2.0


def test_bad_lists():
    """Before any scene is looked at."""
    for make in (
        lambda: values([1.0, np.nan]),
        lambda: values([]),
        lambda: grid(2, 1, 5),
        lambda: grid(0, 1, 5, spacing="log"),
        lambda: grid(0, 1, 1),
        lambda: sobol([0, 0], [1, 1], 8, unit=["mW"]),
        lambda: sobol(0, 1, 8, unit=3),  # type: ignore[arg-type]
        lambda: grid(0, 1, 2, unit=None),  # type: ignore[arg-type]
        lambda: grid("a", 1, 2, unit="mW"),  # type: ignore[arg-type]
        lambda: grid(True, 2, 2),
        lambda: grid([0, 1], 2, 2),  # type: ignore[arg-type]
        lambda: random("a", 1, 2),
        lambda: normal(1, "a", 2),
        lambda: normal([1, 2, 3], [1, 2], 2),
        lambda: Scatter("a"),  # type: ignore[arg-type]
        lambda: half_width("a"),  # type: ignore[arg-type]
        lambda: half_width(0.1, level="a"),  # type: ignore[arg-type]
        lambda: Scatter(-1.0),
        lambda: Scatter(5.0, 3),  # type: ignore[arg-type]
        lambda: half_width(0.7),
        lambda: trials(0),
    ):
        with pytest.raises(InputError, match="allowed"):
            make()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('unit = "mW"', 'unit = "kg"', "unit 'kg'"),
        ("trials = 2048", "trials = -1", "trials is -1"),
        ("seed = 3", 'every = "0 s"', "every is 0.0"),
        ('"trapped"', '"traped"', "did you mean trapped?"),
        ("seed = 3", "sed = 3", "sed is none of its entries"),
        ('"well.usda"', '"wall.usda"', "there is no such file"),
        ("0.1 s", "0.1", "without a unit"),
        ("[stop]", "[stop", "cannot be read"),
        ("values = [0, 0.1, 0.2, 0.3]", "values = [0, nan]", "finite"),
        ("seed = 3", 'time_step = "50 ms"', "time step 0.05 s is unstable"),
        ('unit = "mW"\n', "", "axis trap_power has no unit; allowed: mW"),
        (
            'name = "start.x:/World/bead"\nvalues = [0, 0.1, 0.2, 0.3]\nunit = "µm"',
            'together = [{ name = "seen", values = [1] }, { name = "seen", values = [2] }]',
            "axis seen stands there twice; allowed: once",
        ),
        ("grid = { from = 0.2", "grid = { from = true", "axis trap_power: grid from True to 1; allowed: finite"),
        (
            "grid = { from = 0.2, to = 1, count = 6 }",
            'normal = { mean = 1, deviation = "a", count = 3 }',
            "axis trap_power: normal with mean 1 and deviation a; allowed: finite numbers, no deviation < 0",
        ),
        (
            "grid = { from = 0.2, to = 1, count = 6 }",
            "normal = { mean = 1, count = 3 }",
            "'count': 3}; allowed: a table of mean, deviation and count",
        ),
        ('until = "0.1 s"\n', "", "observable 1 has no until; allowed: name, until"),
        ("[stop]", '[scatter]\ntrap_power = "-5 %"\n[stop]', "scatter of trap_power has the deviation -5"),
        ('unit = "mW"', "unit = 3", "axis trap_power: unit is 3; allowed: a text such as 'mW'"),
        ("[stop]", '[options]\nfast_math = "yes"\n[stop]', "fast_math is 'yes'; allowed: true or false"),
        ("[stop]", '[options]\nintegrator = ["heun"]\n[stop]', "integrator is ['heun']; allowed: "),
    ],
)
def test_bad_files(tmp_path, scene, capsys, old, new, said):
    """One line, exit code 2, and nothing is written."""
    (tmp_path / "well.usda").write_text(scene.read_text())
    assert old in FILE
    (tmp_path / "bad.toml").write_text(FILE.replace(old, new))
    assert main(["study", "run", str(tmp_path / "bad.toml"), "-o", str(tmp_path / "out")]) == 2
    assert said in (error := capsys.readouterr().err) and error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_unwritable(scene):
    """A place that refuses is found out before anything is computed."""
    with pytest.raises(InputError, match="cannot be written"):
        run_study(study_of(scene), "/proc/study")


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"axes": 3}, "axes are 3; allowed: names with grid"),
        ({"axes": [1]}, r"axes are \[1\]; allowed: names"),
        ({"stop": 3}, "stop is 3; allowed: a rule"),
        ({"scatter": 3}, "scatter is 3; allowed: names"),
        ({"scatter": {3: Scatter(5.0)}}, "scatter of 3; allowed: the name of a parameter"),
        ({"options": 3}, "options is 3; allowed: StepOptions"),
        ({"scene": 3}, "scene is 3; allowed: a scene, the path"),
        ({"observables": [trapped]}, r"observables hold trapped without until; allowed: trapped\(until=…\)"),
    ],
)
def test_arguments_of_another_kind(scene, how, said):
    """Each is named."""
    with pytest.raises(InputError, match=said):
        study_of(**({"scene": scene} | how))


@pytest.mark.parametrize(
    ("how", "said"),
    [
        *(({"shard": shard}, "shard is ") for shard in ((3, 2), (0, 2), (0, 1), (-1, 2), (1, 0), 3, "1/2", (1.0, 2))),
        ({"devices": ["foo"]}, "device is 'foo'; allowed: cpu"),
        ({"devices": "cpu"}, "devices are 'cpu'; allowed: a list of names"),
        ({"devices": [3]}, "devices are "),
        ({"engine": 3}, "engine is 3; allowed: a function"),
        ({"progress": 3}, "progress is 3; allowed: a function"),
        ({"folder": 3}, "folder is 3; allowed: a path"),
        ({"folder": None}, "folder is None"),
        ({"folder": b"out"}, "folder is b'out'"),
    ],
)
def test_bad_arguments_of_a_run(scene, tmp_path, how, said):
    """Of `Study.run` and `run_study`; nothing is written."""
    with pytest.raises(InputError, match=said) as error:
        study_of(scene).run(**({"folder": tmp_path / "out"} | how))
    assert "allowed: " in str(error.value) and "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


def test_delivery_needs_a_goal(scene):
    """That of the scene, or one that is given."""
    given = delivered((0.0, 0.0, 10.0), radius=0.1, until=0.1)
    assert study_of(scene, observables=[given]).observables[0].name == "delivered"
    with pytest.raises(InputError, match="the scene has no goal"):
        study_of(scene, observables=[delivered(until=0.1)])
