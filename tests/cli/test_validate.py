"""`otwarp validate` finds what a run of the scene would be refused for, in the words of the run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from otwarp.cli.main import main
from otwarp.scene import Body, Rod, SceneBuilder, Settings, Sphere

SCENES = Path(__file__).parents[2] / "scenes"

COUPLED = ("bool ot:scene:hydrodynamicCoupling = 0", "bool ot:scene:hydrodynamicCoupling = 1")
FLOOR = """def Plane "floor" (
            prepend apiSchemas = ["PhysicsCollisionAPI", {}"MaterialBindingAPI"]
        )
        {{{}
"""
WALL = (FLOOR.format("", ""), FLOOR.format('"OtObstacleAPI", ', "\n            bool ot:obstacle:hydrodynamic = 1"))


def varied(tmp_path: Path, scene: str, *changes: tuple[str, str]) -> Path:
    """A copy of a shipped scene with authored lines changed."""
    text = (SCENES / f"{scene}.usda").read_text()
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = tmp_path / f"{scene}.usda"
    path.write_text(text)
    return path


def rods_in_a_crowd(tmp_path: Path) -> Path:
    ball = Sphere(prim="/World/R/Ball", radius=1.0)
    rod = Rod(prim="/World/R/Arm", start=(0.5, 0.0, 0.0), end=(5.0, 1.0, -2.0), radius=0.4)
    builder = SceneBuilder()
    builder.add(Body(prim="/World/R", spheres=(ball,), rods=(rod,)))
    for i in range(24):
        bead = Sphere(prim=f"/World/B{i}/Ball", radius=1.0)
        builder.add(Body(prim=f"/World/B{i}", position=(4.0 * i, 10.0, 0.0), spheres=(bead,)))
    return builder.save(tmp_path / "rods.usda")


def no_body(tmp_path: Path) -> Path:
    return SceneBuilder().save(tmp_path / "empty.usda")


CASES = {
    "coupled crowd": (
        lambda t: varied(t, "ten_thousand_cells", COUPLED),
        "/World: ot:scene:hydrodynamicCoupling = true: must be false in a scene of 10000 bodies",
    ),
    "coupling beside a wall": (
        lambda t: varied(t, "cell_delivery", COUPLED, WALL),
        "/World: ot:scene:hydrodynamicCoupling = true: must be false beside /World/Channel/floor",
    ),
    "rods in a crowd": (
        rods_in_a_crowd,
        "/World/R/Arm: ot:rod:collides = true: must be false in a scene of 25 bodies",
    ),
    "flow across a wall": (
        lambda t: varied(
            t,
            "microfluidic_channel",
            WALL,
            ("double3 xformOp:translate = (0, 0, 12)\n", "double3 xformOp:translate = (0, 0, 13)\n"),
        ),
        "/World/Channel/floor: ot:obstacle:hydrodynamic = true: must be false where /World/flow flows",
    ),
    "unstable time step": (
        lambda t: varied(t, "single_bead", ("double ot:scene:timeStep = 0", "double ot:scene:timeStep = 0.5")),
        "ot:scene:timeStep, time step 0.5 s is unstable",
    ),
    "more frames than steps": (
        lambda t: varied(
            t,
            "single_bead",
            ("framesPerSecond = 60", "framesPerSecond = 6000"),
            ("double ot:scene:timeStep = 0", "double ot:scene:timeStep = 0.001"),
        ),
        "frames per second is 6000; allowed: up to one per time step, 1000",
    ),
    "no body": (no_body, "has no body; allowed: at least one"),
}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.thorough] if n == "coupled crowd" else []) for n in CASES]
)
def test_what_a_run_would_refuse(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str], device: str) -> None:
    make, words = CASES[name]
    path = make(tmp_path)
    assert main(["validate", str(path)]) == 2
    said = [line for line in capfd.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(said) == 1 and words in said[0]
    assert main(["run", str(path), "--out", str(tmp_path / "out"), "--device", device]) == 2
    assert words in capfd.readouterr().err
    assert not (tmp_path / "out").exists()
    main(["validate", "--json", str(path)])
    report = json.loads(capfd.readouterr().out)
    errors = [finding for finding in report["findings"] if finding["severity"] == "error"]
    assert not report["valid"] and len(errors) == 1
    # a prim that the line names is the finding's
    assert words.startswith(("/World: ", "/World/")) == (errors[0]["prim"] != "/")
    assert f"{errors[0]['prim']}: {errors[0]['message']}".endswith(said[0].partition(f"{path}: ")[2])


def test_what_building_warns_of_is_a_warning(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Weight without noise, so far up that a step of it is lost in the rounding of coordinates."""
    ball = Sphere(
        prim="/World/B/Ball",
        radius=1.0,
    )
    builder = SceneBuilder(settings=Settings(brownian=False, gravity=True, time_step=1e-5))
    builder.add(Body(prim="/World/B", position=(0.0, 0.0, 1e6), spheres=(ball,)))
    path = builder.save(tmp_path / "far.usda")
    assert main(["validate", str(path)]) == 0
    out, error = capfd.readouterr()
    assert f"warning: {path}: /: " in out and "is lost in the rounding of float32 coordinates" in out
    assert error == ""


@pytest.mark.parametrize("name", ["single_bead", "microfluidic_channel", "teleop_small"])
def test_shipped_scenes_are_valid(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    path = SCENES / f"{name}.usda"
    assert main(["validate", str(path)]) == 0
    assert capfd.readouterr() == (f"{path}: valid\n", "")
