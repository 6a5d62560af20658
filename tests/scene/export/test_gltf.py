"""glTF of scenes and recorded runs, held against the stage, trimesh and the validator of the Khronos Group.

The validator runs in Node (`make gltf`); CI sets OTWARP_REQUIRE_GLTF=1, others skip without it.
"""

from __future__ import annotations

import json
import os
import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import export_gltf
from otwarp.scene.drawing.drawables import read_drawables
from otwarp.scene.recording.usd import UsdRecording
from otwarp.scene.transforms import rotation_matrix
from tests.record.small_run import HELD, RATE, frame, load

ROOT = Path(__file__).parents[3]
VALIDATOR = ROOT / ".node" / "node_modules" / "gltf-validator"
SINGLE = 2e-5
"""Places of 80 units in single precision, through up to four nodes [µm]."""
FRAMES = 13

VALIDATE = """
const validator = require(process.argv[1]), fs = require("fs");
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])))
  .then(report => console.log(JSON.stringify(report.issues)));
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded run with instances, arrows, turned and scaled parents, in units of 0.5 µm."""
    folder = tmp_path_factory.mktemp("gltf")
    scene = load(folder / "scene")
    (folder / "run").mkdir()
    recording = UsdRecording(scene, frames_per_second=RATE, held=HELD, forces=True)
    recording.begin(folder / "run")
    for index in range(FRAMES):
        recording.write(frame(scene, index))
    recording.close()
    return folder / "run" / "run.usda"


class Glb:
    """A reader of its own: the document, its arrays, and where nodes are at a time."""

    def __init__(self, file: Path):
        content = file.read_bytes()
        magic, version, size, length = struct.unpack("<4sIII", content[:16])
        assert (magic, version, size) == (b"glTF", 2, len(content))
        self.document = json.loads(content[20 : 20 + length])
        self.binary = content[28 + length :]
        self.names = [node["name"] for node in self.document["nodes"]]
        self.parent = {c: n for n, node in enumerate(self.document["nodes"]) for c in node.get("children", ())}

    def array(self, accessor: int) -> np.ndarray:
        row = self.document["accessors"][accessor]
        view = self.document["bufferViews"][row["bufferView"]]
        kind = {5126: "<f4", 5125: "<u4"}[row["componentType"]]
        data = np.frombuffer(self.binary, kind, offset=view["byteOffset"], count=view["byteLength"] // 4)
        return data.reshape(row["count"], -1).astype(float)

    def local(self, node: int, time: float) -> np.ndarray:
        parts = {"translation": np.zeros(3), "rotation": np.array([0.0, 0.0, 0.0, 1.0]), "scale": np.ones(3)}
        parts |= {name: np.array(self.document["nodes"][node].get(name, value)) for name, value in parts.items()}
        for channel in self.document["animations"][0]["channels"]:
            if channel["target"]["node"] == node:
                sampler = self.document["animations"][0]["samplers"][channel["sampler"]]
                times, rows = self.array(sampler["input"])[:, 0], self.array(sampler["output"])
                value = np.array([np.interp(time, times, column) for column in rows.T])
                parts[channel["target"]["path"]] = value
        out = np.eye(4)
        out[:3, :3] = rotation_matrix(parts["rotation"] / np.linalg.norm(parts["rotation"])) * parts["scale"]
        out[:3, 3] = parts["translation"]
        return out

    def world(self, node: int, time: float) -> np.ndarray:
        matrix = self.local(node, time)
        return self.world(self.parent[node], time) @ matrix if node in self.parent else matrix

    def boxes(self, time: float) -> np.ndarray:
        """(n, 6) lower and upper corners of what is shown, Z up."""
        upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
        rows = []
        for index, node in enumerate(self.document["nodes"]):
            if "mesh" in node:
                matrix = self.world(index, time)
                for primitive in self.document["meshes"][node["mesh"]]["primitives"]:
                    points = self.array(primitive["attributes"]["POSITION"]) @ matrix[:3, :3].T + matrix[:3, 3]
                    points = points @ upright.T
                    if np.ptp(points, axis=0).max() > 0.0:
                        rows.append([*points.min(axis=0), *points.max(axis=0)])
        return np.array(rows)


@pytest.mark.parametrize("index", [0, 5, FRAMES - 1])
def test_everything_is_where_the_stage_shows_it(run: Path, tmp_path: Path, index: int):
    glb = Glb(export_gltf(run, tmp_path / "run.glb", fps=RATE, forces=True))
    drawn = read_drawables(run, float(index), purposes=("default", "render", "guide"))
    wanted = np.concatenate(drawn.bounds(), axis=1)
    found = glb.boxes(index / RATE)
    assert len(found) == len(wanted)
    size = wanted[:, 3:] - wanted[:, :3]
    nearest = np.linalg.norm(wanted[:, None] - found, axis=2)
    assert sorted(nearest.argmin(axis=1)) == list(range(len(found)))
    # 32 flat sides: a turned circle may miss its extreme by 1 − cos(π/32)
    assert (nearest.min(axis=1) <= SINGLE + 0.01 * np.linalg.norm(size, axis=1)).all()


def test_names_times_colours_and_camera(run: Path, tmp_path: Path):
    glb = Glb(export_gltf(run, tmp_path / "run.glb", fps=20.0))
    document = glb.document
    assert {"left", "right", "cell", "Crowd_0", "Crowd_2", "view"} <= set(glb.names)
    (times,) = {sampler["input"] for sampler in document["animations"][0]["samplers"]}
    np.testing.assert_allclose(glb.array(times)[:, 0], np.arange(5) * 0.05, atol=1e-7)
    factors = [m["pbrMetallicRoughness"]["baseColorFactor"] for m in document["materials"]]
    assert [0.9, 0.27, 0.04, 1.0] in factors
    assert all(
        (m.get("alphaMode") == "BLEND") == (f[3] < 1.0) for m, f in zip(document["materials"], factors, strict=True)
    )
    assert len(document["cameras"]) == 1
    assert not [name for name in glb.names if name.startswith("trap_World")]  # arrows were not asked for


def test_metres_are_a_millionth(run: Path, tmp_path: Path):
    micro, metres = (Glb(export_gltf(run, tmp_path / f"{m}.glb", metres=m)) for m in (False, True))
    np.testing.assert_allclose(metres.boxes(0.1), 1e-6 * micro.boxes(0.1), rtol=1e-5, atol=1e-11)


def test_trimesh_reads_the_same_sizes(run: Path, tmp_path: Path):
    trimesh = pytest.importorskip("trimesh")
    file = export_gltf(run, tmp_path / "run.glb")
    scene = trimesh.load(file)
    low, high = Glb(file).boxes(0.0)[:, :3].min(axis=0), Glb(file).boxes(0.0)[:, 3:].max(axis=0)
    x, y, z = scene.extents
    np.testing.assert_allclose([x, z, y], high - low, rtol=1e-5)


@pytest.mark.parametrize("what", ["run", "cell_delivery", "microfluidic_channel"])
def test_the_validator_has_nothing_to_say(run: Path, tmp_path: Path, what: str):
    if not VALIDATOR.exists() or shutil.which("node") is None:
        if os.environ.get("OTWARP_REQUIRE_GLTF") == "1":
            pytest.fail("OTWARP_REQUIRE_GLTF=1, and there is no validator: `make gltf`")
        pytest.skip("the glTF validator is absent: `make gltf`")
    file = export_gltf(run if what == "run" else ROOT / "scenes" / f"{what}.usda", tmp_path / "out.glb", forces=True)
    said = subprocess.run(
        ["node", "-e", VALIDATE, str(VALIDATOR), str(file)], capture_output=True, text=True, timeout=120, check=True
    )
    report = json.loads(said.stdout)
    assert (report["numErrors"], report["numWarnings"]) == (0, 0), report["messages"][:5]


def test_bad_input_leaves_no_file(run: Path, tmp_path: Path):
    with pytest.raises(InputError, match=r"suffix = \.gltf: must be \.glb"):
        export_gltf(run, tmp_path / "run.gltf")
    with pytest.raises(InputError, match="there is no such file"):
        export_gltf(tmp_path / "none.usda", tmp_path / "run.glb")
    empty = tmp_path / "empty.usda"
    empty.write_text(
        '#usda 1.0\n(\ndefaultPrim = "World"\nmetersPerUnit = 1e-6\nupAxis = "Z"\n)\ndef Xform "World"\n{\n}\n'
    )
    with pytest.raises(InputError, match="shapes = none visible"):
        export_gltf(empty, tmp_path / "run.glb")
    assert not list(tmp_path.glob("*.glb"))
