"""What a run's files say about how it was made, and that they keep the digits which it had."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import warp as wp
import xarray as xr
from pxr import Usd, UsdGeom

import otwarp as ot
from otwarp.record.method import Method
from otwarp.record.netcdf import check_size
from otwarp.record.read import read_run
from otwarp.record.recorder import Recorder
from otwarp.record.run import record_run
from otwarp.scene import Scene
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from tests.record.small_run import HELD, RATE, frame

SCENES = Path(__file__).parents[2] / "scenes"

FAR = 1e5
"""µm from the origin: coordinates of float32 are 8 nm apart there."""

EXACT = 1e-9
"""µm: float64 coordinates of 1e5 µm are 1.5e-11 apart; a few products with the matrix of the parent."""


def far_bead() -> Scene:
    """The bead of the shipped scene with its trap, far from the origin along x."""
    scene = Scene.load(SCENES / "single_bead.usda", duration=0.05)
    (body,), (trap,) = scene.bodies, scene.traps
    shift = np.array([FAR, 0.0, 0.0])
    track = dataclasses.replace(trap.position, values=trap.position.values + shift)
    moved = dataclasses.replace(body, position=tuple(float(x) for x in np.array(body.position) + shift))
    return dataclasses.replace(scene, bodies=(moved,), traps=(dataclasses.replace(trap, position=track),))


@pytest.mark.thorough
@pytest.mark.parametrize(("precision", "kind"), [("float32", "f4"), ("float64", "f8")])
@pytest.mark.filterwarnings("ignore:.*falsified by the rounding of float32")
def test_files_keep_the_digits_of_the_run(precision: str, kind: str, device: str, tmp_path: Path) -> None:
    end = tmp_path / "end.npz"
    options = StepOptions(time_step=1e-4, precision=precision)
    record_run(far_bead(), tmp_path / "run", device=device, checkpoint=end, options=options)
    state = np.load(end)["state.position"]
    assert state.dtype == np.dtype(kind)
    # digits that float32 cannot hold are what this is about
    assert (precision == "float64") == bool(np.any(state != state.astype(np.float32)))
    with xr.open_dataset(tmp_path / "run" / "run.nc") as data:
        for name in ("position", "orientation", "trap_position", "trap_force", "trap_distance", "trap_power"):
            assert data[name].dtype == np.dtype(kind), name
        np.testing.assert_array_equal(data["position"][-1], state)
        code = data.sizes["frame"] - 1
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    prim = stage.GetPrimAtPath(far_bead().bodies[0].prim)
    place = UsdGeom.XformCache(code).GetLocalToWorldTransform(prim).ExtractTranslation()
    np.testing.assert_allclose(np.array(place), state[0, 0], atol=EXACT, rtol=0.0)


@pytest.mark.parametrize(("kind", "power"), [(np.float32, 0.02), (np.float64, 0.02 + 2.0**-45)])
def test_powers_in_usd_have_the_digits_of_the_run(scene: Scene, tmp_path: Path, kind: type, power: float) -> None:
    with Recorder(scene, tmp_path / "run", frames_per_second=RATE, held=HELD, time_step=1e-3, figure=False) as out:
        out.write(frame(scene, 0, trap_power=np.full((1, 2), 1e3 * power).astype(kind)))
    stage = Usd.Stage.Open(str(tmp_path / "run" / "run.usda"))
    written = stage.GetPrimAtPath(scene.traps[0].prim).GetAttribute("ot:trap:power").Get(0)
    # of float32, the decimal number that was meant; of float64, fifteen digits
    assert written == power if kind is np.float32 else written == pytest.approx(power, rel=1e-14)


def test_twice_the_digits_take_twice_the_room(scene: Scene, device: str) -> None:
    double = dataclasses.replace(METHOD, precision="float64")
    assert check_size(scene, 3, double) == 2 * check_size(scene, 3, METHOD) == 2 * check_size(scene, 3)


METHOD = Method(
    precision="float32",
    integrator="exponential",
    noise="threePoint",
    fast_math=True,
    crossings=False,
    coupling=True,
    driver="world",
    device="cuda:3",
    device_name="a device",
)


PUSHED = dataclasses.replace(METHOD, forces={"push": "0a" * 32, "spring": "1b" * 32})


@ot.force(strength="pN")
def push(body: ot.ForceInput, strength: float):
    return wp.vec3(strength, 0.0, 0.0)


def test_files_of_runs_without_forces_do_not_mention_them() -> None:
    """They are what they were before there were any."""
    assert "forces" not in METHOD.facts() | METHOD.attributes()
    assert Method.read(METHOD.attributes()) == METHOD
    assert METHOD.forces == {}


@pytest.mark.parametrize("method", [METHOD, PUSHED], ids=["without forces", "with forces"])
def test_what_a_file_says_is_read_back(method: Method, scene: Scene, tmp_path: Path) -> None:
    options = {"frames_per_second": RATE, "held": HELD, "time_step": 1e-3, "figure": False, "usd_world": None}
    with Recorder(scene, tmp_path / "run", method=method, **options) as out:
        out.write(frame(scene, 0))
    run = read_run(tmp_path / "run" / "run.nc")
    assert (run.method, run.time_step) == (method, 1e-3)
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["method"] == method.facts()
    with Recorder(scene, tmp_path / "silent", **options) as out:
        out.write(frame(scene, 0))
    assert read_run(tmp_path / "silent" / "run.nc").method is None


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({}, {"precision": "float32", "integrator": "heun", "noise": "gaussian", "fast_math": False}),
        (
            {"precision": "float64", "integrator": "leimkuhlerMatthews", "noise": "threePoint"},
            {"precision": "float64", "integrator": "leimkuhlerMatthews", "noise": "threePoint", "fast_math": False},
        ),
        ({"fast_math": True, "integrator": "eulerMaruyama"}, {"integrator": "eulerMaruyama", "fast_math": True}),
    ],
)
def test_a_run_says_how_it_was_made(options: dict, expected: dict, device: str, tmp_path: Path) -> None:
    """In the summary, in run.nc and, read back, in the same words."""
    scene = Scene.load(SCENES / "single_bead.usda", duration=0.02)
    summary = record_run(scene, tmp_path / "run", device=device, options=StepOptions(time_step=0.001, **options))
    said = summary["method"]
    assert {k: said[k] for k in expected} == expected
    assert (said["driver"], said["coupling"], said["crossings"], said["device"]) == ("solo", False, True, device)
    assert said["device_name"]
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["method"] == said
    method = read_run(tmp_path / "run" / "run.nc").method
    assert method is not None and method.facts() == said
    with xr.open_dataset(tmp_path / "run" / "run.nc") as data:
        assert (data.attrs["precision"], data.attrs["time_step"]) == (said["precision"], 1e-3)


def test_a_run_says_which_integrator_served_and_that_bodies_were_coupled(scene: Scene, device: str) -> None:
    settings = dataclasses.replace(scene.settings, coupling=True, brownian=False, integrator="exponential")
    method = Method.of(Model.build(dataclasses.replace(scene, settings=settings), device=device))
    assert (method.coupling, method.driver, method.integrator, method.noise) == (True, "world", "heun", "none")


@pytest.mark.thorough
def test_a_run_says_which_forces_acted(device: str, tmp_path: Path) -> None:
    """The user's, and those that bodies of the scene author."""
    scene = Scene.load(SCENES / "single_bead.usda", duration=0.02)
    options = StepOptions(time_step=0.001, forces=(push(strength=2.0),))
    summary = record_run(scene, tmp_path / "run", device=device, options=options)
    assert summary["method"]["forces"] == {"push": push.body_force.digest}
    method = read_run(tmp_path / "run" / "run.nc").method
    assert method is not None
    assert method.forces == {"push": push.body_force.digest}
    (bead,) = scene.bodies
    authored = dataclasses.replace(bead, forces={"external_force": (1.0, 0.0, 0.0)})
    model = Model.build(dataclasses.replace(scene, bodies=(authored,)), device=device)
    assert list(Method.of(model).forces.values()) == [force.digest for force in model.forces.body_forces] != []
