"""`otwarp mobility` and `otwarp decompose` as typed."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from otwarp.cli.main import main
from otwarp.scene import Body, Medium, Rod, Scene, SceneBuilder, Sphere
from otwarp.units import BOLTZMANN

ENERGY_OVER_VISCOSITY = BOLTZMANN * Medium().temperature / Medium().viscosity


TWO_PILLS = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1e-6
    upAxis = "Z"
    startTimeCode = 0
    endTimeCode = 60
    timeCodesPerSecond = 60
    framesPerSecond = 60
)
def Xform "World" (prepend apiSchemas = ["OtSceneAPI"])
{
    def "left" (prepend references = @pill.usda@)
    {
        double3 xformOp:translate = (0, 0, 5)
    }
    def "right" (prepend references = @pill.usda@)
    {
        double3 xformOp:translate = (0, 9, 5)
    }
}
"""


@pytest.fixture(autouse=True, scope="module")
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OTWARP_CACHE", str(tmp_path_factory.mktemp("mobilities")))
        yield


def dimer(name: str, x: float, *, rod: bool = False) -> Body:
    path = f"/World/{name}"
    spheres = tuple(Sphere(prim=f"{path}/s{k}", offset=(0, 0, 2.0 * k), radius=1.0) for k in (0, 1))
    rods = (Rod(prim=f"{path}/rod", start=(0, 0, 0), end=(0, 0, 6), radius=0.5),) if rod else ()
    return Body(prim=path, position=(x, 0, 5), spheres=spheres, rods=rods)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    builder = SceneBuilder()
    builder.add(dimer("a", 0.0))
    builder.add(dimer("b", 10.0))
    builder.add(dimer("long", 20.0, rod=True))
    builder.add(Body(prim="/World/bead", position=(30, 0, 5), spheres=(Sphere(prim="/World/bead/s", radius=2.0),)))
    return builder.save(tmp_path_factory.mktemp("scene") / "scene.usda")


def output(capfd) -> str:
    captured = capfd.readouterr()
    assert captured.err == ""
    return captured.out


def test_json_of_a_scene(scene, capfd):
    assert main(["mobility", str(scene), "--json"]) == 0
    rows = json.loads(output(capfd))["bodies"]
    assert [row["count"] for row in rows] == [2, 1, 1]
    pair, rod, bead = rows
    assert pair["bodies"] == ["/World/a", "/World/b"]
    # touching dimer: friction 0.645 and 0.724 of two spheres apart (Stimson & Jeffery; Goldman, Cox & Brenner)
    expected = ENERGY_OVER_VISCOSITY / (12 * np.pi * np.array([0.64514, 0.72466, 0.72466]))
    np.testing.assert_allclose(pair["translation"]["coefficients"], expected, rtol=0.002)
    np.testing.assert_allclose(pair["translation"]["axes"][0], [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(pair["centre_of_diffusion"], [0, 0, 1], atol=1e-9)
    assert 0 < pair["estimated_error"] <= 0.01 and pair["blobs"] == 48
    assert rod["rods"] == 1
    assert rod["translation"]["coefficients"][0] < pair["translation"]["coefficients"][0]
    assert rod["centre_of_diffusion"][2] > 1.5
    assert bead["estimated_error"] == 0.0 and bead["blobs"] == 0
    np.testing.assert_allclose(bead["rotation"]["coefficients"], ENERGY_OVER_VISCOSITY / (8 * np.pi * 8), rtol=1e-9)


def test_accuracy_of_the_command_goes_before_the_scene(scene, tmp_path, capfd):
    file = tmp_path / "m.json"
    assert main(["mobility", str(scene), "--accuracy", "0", "--out", str(file)]) == 0
    assert "not estimated" in output(capfd)
    pair, rod, _ = json.loads(file.read_text())["bodies"]
    # pair mobilities: 8/13 along the axis, by hand; the rod is left out
    assert pair["translation"]["coefficients"][0] == pytest.approx(ENERGY_OVER_VISCOSITY / (12 * np.pi * 8 / 13))
    assert pair["estimated_error"] is None
    assert rod["translation"]["coefficients"] == pair["translation"]["coefficients"]


def test_table_names_bodies_and_errors(scene, capfd):
    assert main(["mobility", str(scene)]) == 0
    out = output(capfd)
    assert "a + 1" in out and "long" in out and "exact" in out and " %" in out


def test_bad_accuracy_is_one_line(scene, capfd):
    assert main(["mobility", str(scene), "--accuracy", "0.7"]) == 2
    err = capfd.readouterr().err
    assert err.count("\n") == 1
    assert "--accuracy is 0.7; allowed: 0 to 0.5" in err


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    capsule = trimesh.creation.capsule(height=2.0, radius=1.0, count=(24, 24))
    return capsule.export(str(tmp_path_factory.mktemp("mesh") / "2 pill.stl")) and next(
        tmp_path_factory.getbasetemp().glob("mesh*/2 pill.stl")
    )


@pytest.mark.thorough
def test_decompose_writes_a_body_that_scenes_accept(mesh, tmp_path, capfd):
    body = tmp_path / "pill.usda"
    command = ["decompose", str(mesh), "-n", "4", "-o", str(body)]
    assert main(command) == 0
    out = output(capfd)
    assert "volume in one but not in both" in out and "mobility, against the mesh's" in out and "/body_2_pill" in out
    assert main([*command, "--json"]) == 0
    found = json.loads(output(capfd))
    assert 1 < len(found["spheres"]) <= 4
    assert found["volume_error"] < 0.15 and found["mobility_error"] < 0.05
    scene = tmp_path / "scene.usda"
    scene.write_text(TWO_PILLS)
    assert main(["validate", str(scene)]) == 0
    capfd.readouterr()
    left, right = Scene.load(scene).bodies
    assert left.position == (0, 0, 5) and right.position == (0, 9, 5)
    np.testing.assert_allclose([s.radius for s in left.spheres], [s["radius"] for s in found["spheres"]])
    np.testing.assert_allclose([s.offset for s in left.spheres], [s["centre"] for s in found["spheres"]], atol=1e-12)
    assert main(["validate", str(body)]) == 0


def test_decompose_to_a_wanted_error(mesh, capfd):
    assert main(["decompose", str(mesh), "--volume-error", "0.3", "--scale", "5e-7", "--json"]) == 0
    found = json.loads(output(capfd))
    assert found["volume_error"] <= 0.3
    assert found["volume"] == pytest.approx((2 * np.pi + 4 / 3 * np.pi) / 8, rel=0.03)


def test_decompose_refuses(tmp_path, capfd):
    assert main(["decompose", str(tmp_path / "none.stl")]) == 2
    err = capfd.readouterr().err
    assert err.count("\n") == 1 and "no such file" in err
