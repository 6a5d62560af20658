"""Why and where trials ended, functions in files of one's own, contours as lines."""

from __future__ import annotations

import json

import numpy as np
import pytest
import warp as wp

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.kernels.core.types import ReadoutData, StateData, WorldNow
from otwarp.kernels.drivers.numbers import first_lost as first_lost_of
from otwarp.studies.contours import contour_lines
from otwarp.studies.file import load_study
from otwarp.studies.outcomes import left_behind, place
from otwarp.studies.stopping.intervals import interval
from otwarp.studies.store import open_store
from otwarp.studies.study import Study
from tests.studies.scenes import bead_in_a_well

xarray = pytest.importorskip("xarray")
pytest.importorskip("zarr")

OWN = """
import otwarp as ot

LIMIT = 0.3

@ot.observable(keep="largest", unit="µm")
def height(now: ot.WorldNow, body: int = 0) -> float:
    return now.state.position[now.world, body][2]

@ot.end
def aside(now: ot.WorldNow, far: float = LIMIT) -> bool:
    return now.state.position[now.world, 0][0] > far
"""

FILE = """
scene = "well.usda"
[[axis]]
name = "trap_power"
values = [0.3, 1]
unit = "mW"
[[observable]]
kind = "trapped"
until = "0.05 s"
[[observable]]
file = "own.py"
function = "height"
[[observable]]
file = "own.py"
function = "aside"
until = "0.05 s"
far = 0.2
name = "went_aside"
[[observable]]
kind = "outcome"
[[observable]]
kind = "first_lost"
[[observable]]
kind = "place"
along = "x"
[stop]
trials = 256
"""

_first_lost = wp.func(first_lost_of)


@wp.kernel
def _read(state: StateData, readout: ReadoutData, out: wp.array(dtype=wp.float32)):  # type: ignore[valid-type]
    world = wp.tid()
    out[world] = _first_lost(WorldNow(world, wp.int64(0), wp.float32(0.0), state, readout))  # type: ignore[call-arg]


@pytest.mark.thorough
def test_the_first_of_several_traps():
    """None, one, the earlier of two whatever their order, and several that lost theirs in one step."""
    steps = [[-1, -1, -1], [-1, 7, -1], [9, 7, 8], [5, 6, 4], [4, 6, 4], [5, 5, 4], [3, 3, 3]]
    readout, out = ReadoutData(), wp.zeros(len(steps), dtype=wp.float32, device="cpu")
    readout.escape_step = wp.array(steps, dtype=wp.int64, device="cpu", ndim=2)
    wp.launch(_read, dim=len(steps), inputs=[StateData(), readout, out], device="cpu")
    assert out.numpy().tolist() == [-1, 1, 1, 2, 3, 2, 3]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    here = tmp_path_factory.mktemp("own")
    bead_in_a_well(here)
    (here / "own.py").write_text(OWN)
    (here / "s.toml").write_text(FILE)
    return here


@pytest.mark.thorough
def test_functions_of_a_file(folder):
    """They run, their digests are kept, and another text is another study."""
    study = load_study(folder / "s.toml")
    found = study.run(folder / "out", devices=["cpu"])
    shares = [found[f"outcome_{name}"] for name in ("escaped", "aside", "none")]
    assert np.allclose(sum(shares), 1.0)
    assert np.array_equal(found["outcome_aside_count"], found["went_aside_count"])
    assert np.array_equal(found["first_lost_trap_count"], found["outcome_escaped_count"])
    assert np.all(found["first_lost_several_count"] == 0)
    assert np.array_equal(found["outcome_escaped_count"] + found["trapped_count"], [256, 256])
    assert np.all(found["height"] > 10.0) and found["height"].attrs["units"] == "µm"
    with open_store(folder / "out").read() as raw:
        aside = raw["end"].values == 2
        assert aside.sum() > 20 and np.all(raw["place_x_of_trial"].values[aside] > 0.2)
        x, end = raw["place_x_of_trial"].values.astype(float), raw["end"].values
    for name, code in (("escaped", 1), ("aside", 2), ("none", 0)):  # where, by what became of a trial
        for n in range(2):
            mine = x[n][end[n] == code]
            assert found[f"place_x_{name}"].values[n] == pytest.approx(
                mine.mean() if len(mine) else np.nan, nan_ok=True
            )
            if len(mine) > 1:
                error = mine.std(ddof=1) / np.sqrt(len(mine))
                assert found[f"place_x_{name}_error"].values[n] == pytest.approx(error)
    assert found["place_x_aside"].values[0] > 0.2 and found["place_x"].values[0] < found["place_x_aside"].values[0]
    said = json.loads((folder / "out" / "study.json").read_text())["observables"]
    assert len({o["sha256"] for o in said if "sha256" in o}) == 5
    (folder / "own2.py").write_text(OWN.replace("[2]", "[1]"))
    other = load_study(_with(folder, '"own.py"\nfunction = "height"', '"own2.py"\nfunction = "height"'))
    with pytest.raises(InputError, match="another observables"):
        other.run(folder / "out", devices=["cpu"])
    for name in ("outcome", "trapped", "height"):
        assert (
            main(["study", "show", str(folder / "out"), "--plot", str(folder / f"{name}.svg"), "--observable", name])
            == 0
        )


def _with(folder, old, new):
    assert old in FILE
    file = folder / "other.toml"
    file.write_text(FILE.replace(old, new))
    return file


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('function = "height"', 'function = "hight"', "has no hight; allowed: height, aside"),
        ('function = "height"', 'function = "LIMIT"', "is float; allowed: @ot.observable"),
        ('function = "height"', "function = 3", "allowed: kind, or file and function"),
        (
            'file = "own.py"\nfunction = "height"',
            'file = "mine.py"\nfunction = "height"',
            "a Python file that is there",
        ),
        ('file = "own.py"\nfunction = "height"', 'file = "bad.py"\nfunction = "height"', "NameError: name 'oops'"),
        ('function = "height"', 'function = "height"\nbdy = 1', "no parameter bdy; allowed: body"),
        ('name = "went_aside"', 'name = "went aside"', "allowed: letters, digits and _"),
        ('along = "x"', 'along = "w"', "allowed: x, y, z"),
        ('kind = "outcome"', 'kind = "outcomes"', "allowed: trapped"),
    ],
)
def test_bad_observables(folder, old, new, said, capsys):
    """One line, exit code 2."""
    (folder / "bad.py").write_text("oops\n")
    assert main(["study", "run", str(_with(folder, old, new)), "-o", str(folder / "none")]) == 2
    assert said in (error := capsys.readouterr().err) and error.count("\n") == 1
    assert not (folder / "none").exists()


def test_what_a_scene_lacks(folder):
    for observable, said in ((left_behind(until=0.1), "no goal"), (place(along="x", body="/World/bed"), "/World/bead")):
        with pytest.raises(InputError, match=said):
            Study(folder / "well.usda", observables=[observable], horizon=0.1)


def test_a_contour_holds_the_circle_that_it_is_of():
    """P = ½ on a circle of 50 maps: the line lies on it, and each end of the band beyond it as often as it says."""
    x = np.linspace(0.0, 2.0, 21)
    y = np.geomspace(0.5, 2.0, 15)
    radius = np.hypot(x[:, None], np.log2(y)[None, :] + 1.0)
    chance, n = 1.0 / (1.0 + np.exp(8.0 * (radius - 1.2))), 400
    random = np.random.Generator(np.random.Philox(4))
    off, inside = [], []
    for _ in range(50):
        k = random.binomial(n, chance)
        low, high = interval(k, n)
        parts = {"p": k / n, "p_low": low, "p_high": high}
        found = xarray.Dataset({name: (("x", "y"), v) for name, v in parts.items()}, coords={"x": x, "y": y})
        lines = contour_lines(found, "p", 0.5)
        r = np.hypot(lines["x"], np.log2(lines["y"]) + 1.0).values
        off.append(np.mean(r[lines["through"] == "estimate"]) - 1.2)
        inside += [(r[lines["through"] == "inside"] < 1.2), (r[lines["through"] == "outside"] > 1.2)]
    assert abs(np.mean(off)) < 5.0 * np.std(off) / np.sqrt(len(off)) + 0.005
    assert np.mean(np.concatenate(inside)) > 0.97 - 0.01
    for name, level, said in (("q", 0.5, "a probability of the study"), ("p", 1.5, "above 0 and below 1")):
        with pytest.raises(InputError, match=said):
            contour_lines(found, name, level)
    with pytest.raises(InputError, match="two axes"):
        contour_lines(found.isel(x=0), "p", 0.5)
