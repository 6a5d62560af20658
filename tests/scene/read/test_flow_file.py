"""Velocity fields from NumPy, netCDF and VTK files, and from a stage that names one."""

from __future__ import annotations

import base64
import json
import re
import zlib
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.scene import Flow, Scene, SceneBuilder, Settings, Sphere
from otwarp.scene.description import Body
from otwarp.scene.export.stage import export_in_metres
from otwarp.scene.flow_grid import FlowGrid
from otwarp.scene.read.flow_file import read_flow_grid

LOW, SPACING, NODES = (-10.0, -4.0, 0.0), (2.0, 4.0, 0.5), (5, 3, 4)
FIELD = FlowGrid(low=LOW, spacing=SPACING, velocity=np.random.default_rng(0).normal(size=(*NODES, 3)))
AXES = [1e-6 * (a + h * np.arange(n)) for a, h, n in zip(LOW, SPACING, NODES, strict=True)]
SI = 1e-6 * FIELD.velocity


def npz(path: Path, **changed) -> Path:
    np.savez(path, **{**dict(zip("xyz", AXES, strict=True)), "velocity": SI, **changed})
    return path


def parts(path: Path) -> Path:
    np.savez(path, **dict(zip("xyzuvw", [*AXES, *np.moveaxis(SI, -1, 0)], strict=True)))
    return path


def netcdf(path: Path, length: str = "um", speed: str = "um/s", per_um: float = 1.0) -> Path:
    """In µm and µm/s, or as its units say, and z first, as models of the atmosphere write."""
    with netCDF4.Dataset(path, "w") as data:
        for name, places in zip("xyz", AXES, strict=True):
            data.createDimension(name, len(places))
            variable = data.createVariable(name, "f8", (name,))
            variable.units = length
            variable[:] = per_um * 1e6 * places
        for name, part in zip("uvw", np.moveaxis(FIELD.velocity, -1, 0), strict=True):
            variable = data.createVariable(name, "f8", ("z", "y", "x"))
            variable.units = speed
            variable[:] = per_um * part.transpose(2, 1, 0)
    return path


def vti(path: Path, how: str) -> Path:
    flat = SI.transpose(2, 1, 0, 3).astype("<f8").tobytes()
    head = np.array([len(flat)], "<u8").tobytes()
    text, more = " ".join(map(repr, np.frombuffer(flat).tolist())), ""
    if how == "binary":
        text = base64.b64encode(head + flat).decode()
    elif how == "zlib":
        blocks = [flat[i : i + 400] for i in range(0, len(flat), 400)]
        packed = [zlib.compress(b) for b in blocks]
        sizes = np.array([len(blocks), 400, len(blocks[-1]) % 400, *map(len, packed)], "<u8").tobytes()
        text = base64.b64encode(sizes).decode() + base64.b64encode(b"".join(packed)).decode()
        more = ' compressor="vtkZLibDataCompressor"'
    kind = "ascii" if how == "ascii" else "binary"
    extent = " ".join(f"0 {n - 1}" for n in NODES)
    path.write_text(
        f'<VTKFile type="ImageData" byte_order="LittleEndian" header_type="UInt64"{more}>'
        f'<ImageData WholeExtent="{extent}" Origin="{" ".join(repr(1e-6 * v) for v in LOW)}" '
        f'Spacing="{" ".join(repr(1e-6 * v) for v in SPACING)}"><Piece Extent="{extent}"><PointData>'
        f'<DataArray type="Float64" Name="U" NumberOfComponents="3" format="{kind}">{text}</DataArray>'
        "</PointData></Piece></ImageData></VTKFile>"
    )
    return path


MADE = {
    "velocity.npz": npz,
    "parts.npz": parts,
    "field.nc": netcdf,
    "ascii.vti": lambda path: vti(path, "ascii"),
    "binary.vti": lambda path: vti(path, "binary"),
    "zlib.vti": lambda path: vti(path, "zlib"),
}


@pytest.mark.parametrize("name", MADE)
def test_every_format_holds_the_same_field(name, tmp_path):
    found = read_flow_grid(MADE[name](tmp_path / name))
    np.testing.assert_allclose(found.low, LOW, atol=1e-9)
    np.testing.assert_allclose(found.spacing, SPACING, rtol=1e-12)
    np.testing.assert_allclose(found.velocity, FIELD.velocity, rtol=1e-12)


UNITS = [
    ("", "", 1e-6),
    ("m", "m s-1", 1e-6),
    ("metres", "meters/second", 1e-6),
    ("cm", "cm/s", 1e-4),
    ("mm", "mm s^-1", 1e-3),
    ("μm", "µm·s⁻¹", 1.0),
    ("microns", "micron per sec", 1.0),
    ("nm", "nm*s**-1", 1e3),
]


@pytest.mark.parametrize(("length", "speed", "per_um"), UNITS)
def test_netcdf_is_in_the_units_that_it_names(length, speed, per_um, tmp_path):
    found = read_flow_grid(netcdf(tmp_path / "field.nc", length, speed, per_um))
    np.testing.assert_allclose(found.spacing, SPACING, rtol=1e-12)
    np.testing.assert_allclose(found.velocity, FIELD.velocity, rtol=1e-12)


@pytest.mark.parametrize(
    ("length", "speed", "message"),
    [
        ("furlong", "m/s", "x: units = 'furlong': must be a length, in m, cm, mm, um, nm, or none for SI"),
        ("m/s", "m/s", "x: units = 'm/s': must be a length, in"),
        ("um", "um", "u: units = 'um': must be a length per second, in m, cm"),
        ("um", "um/min", "u: units = 'um/min': must be a length per second"),
        ("Mm", "m/s", "x: units = 'Mm': must be a length"),
    ],
)
def test_units_of_netcdf_that_are_not_known_are_refused(length, speed, message, tmp_path):
    with pytest.raises(InputError, match=message):
        read_flow_grid(netcdf(tmp_path / "field.nc", length, speed))


def test_image_data_in_pieces_is_refused(tmp_path):
    text = vti(tmp_path / "whole.vti", "ascii").read_text()
    piece = text[text.index("<Piece") : text.index("</ImageData>")]
    (tmp_path / "two.vti").write_text(text.replace(piece, 2 * piece))
    with pytest.raises(InputError, match="2 pieces: must be one that holds all nodes"):
        read_flow_grid(tmp_path / "two.vti")


def cube(path: Path, velocity: tuple[str, ...]) -> Path:
    """A field whose u grows along x alone, on as many nodes along each axis; dimensions i, j, k belong to x, y, z."""
    with netCDF4.Dataset(path, "w") as data:
        for name, dimension in zip("xyz", "ijk", strict=True):
            data.createDimension(dimension, 3)
            data.createVariable(name, "f8", (dimension,))[:] = 1e-6 * np.arange(3)
        data.createDimension("other", 3)
        for name in "uvw":
            along_x = np.arange(3.0) if name == "u" else np.zeros(3)
            shape = [3 if d == "i" else 1 for d in velocity]
            data.createVariable(name, "f8", velocity)[:] = np.broadcast_to(along_x.reshape(shape), (3, 3, 3))
    return path


@pytest.mark.parametrize("velocity", [("i", "j", "k"), ("k", "j", "i"), ("j", "i", "k")])
def test_dimensions_of_netcdf_are_told_apart_by_those_of_the_places(velocity, tmp_path):
    found = read_flow_grid(cube(tmp_path / "field.nc", velocity)).velocity
    assert np.ptp(found[..., 0], axis=0).min() == 2e6 and not np.ptp(found[..., 0], axis=(1, 2)).any()


def test_a_dimension_of_netcdf_that_no_place_has_is_refused(tmp_path):
    with pytest.raises(InputError, match="u has dimensions other, j, i: must have those of x, y and z, i, j, k; k is"):
        read_flow_grid(cube(tmp_path / "field.nc", ("other", "j", "i")))


def test_halfway_between_nodes_is_their_mean():
    middle = np.array(LOW) + 0.5 * np.array(SPACING)
    np.testing.assert_allclose(FIELD.at(middle[None])[0], FIELD.velocity[:2, :2, :2].mean(axis=(0, 1, 2)))
    assert not FIELD.at(np.array([LOW]) - 1e-3).any()


BAD = {
    "uneven": ({"x": np.array([0.0, 1.0, 2.0, 3.0, 5.0])}, "x = 5 places: must be 2 or more, rising by equal steps"),
    "shape": ({"velocity": SI[1:]}, r"velocity has shape \(4, 3, 4, 3\): must be \(5, 3, 4, 3\)"),
    "nan": ({"velocity": np.full_like(SI, np.nan)}, r"velocity\[0\]\[0\]\[0\]\[0\] = nan: must be finite"),
    "complex": ({"velocity": SI * (1 + 1j)}, "field.npz: velocity is of type complex128: must be real numbers"),
    "complex places": ({"x": AXES[0] + 0j}, "field.npz: x is of type complex128: must be real numbers"),
    "objects": ({"velocity": np.array([{}])}, "not a readable velocity field"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_field_is_refused_in_one_line(case, tmp_path):
    changed, message = BAD[case]
    with pytest.raises(InputError, match=message) as error:
        read_flow_grid(npz(tmp_path / "field.npz", **changed))
    assert "\n" not in str(error.value)


def test_other_files_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"suffix '.txt': must be one of .npz, .nc, .vti, .vtk"):
        read_flow_grid(tmp_path / "field.txt")
    for name in ("none.npz", "none.nc", "none.vti", "none.vtk"):
        with pytest.raises(InputError, match="No such file"):
            read_flow_grid(tmp_path / name)
    (tmp_path / "broken.vti").write_text("<VTKFile>")
    with pytest.raises(InputError, match="not a readable velocity field"):
        read_flow_grid(tmp_path / "broken.vti")


def stage(tmp_path: Path, file: str = "field.npz", field: FlowGrid | None = FIELD) -> SceneBuilder:
    builder = SceneBuilder(settings=Settings(duration=0.01))
    ball = Sphere(prim="/World/Bead/S", radius=0.5)
    builder.add(Body(prim="/World/Bead", position=(-4.0, 0.0, 0.8), spheres=(ball,)))
    builder.add(Flow(prim="/World/Flow", kind="grid", file=file, field=field))
    return builder


def test_a_stage_names_the_file_and_info_tells_the_divergence(tmp_path, monkeypatch, capsys):
    """The path is relative to the stage, wherever one stands."""
    npz(tmp_path / "field.npz")
    monkeypatch.chdir(tmp_path)
    stage(tmp_path, "./field.npz").save(tmp_path / "scene.usda")
    monkeypatch.chdir("/")
    scene = Scene.load(tmp_path / "scene.usda")
    assert scene.flow is not None and scene.flow.field is not None
    np.testing.assert_allclose(scene.flow.field.velocity, FIELD.velocity, rtol=1e-12)
    assert main(["info", str(tmp_path / "scene.usda"), "--json"]) == 0
    about = json.loads(capsys.readouterr().out)["flow"]
    assert (about["kind"], about["nodes"]) == ("grid", list(NODES))
    gradient = FIELD.gradient
    div = gradient[..., 0, 0] + gradient[..., 1, 1] + gradient[..., 2, 2]
    assert about["divergence"] == pytest.approx(np.sqrt((div**2).mean() / (gradient**2).sum(axis=(-2, -1)).mean()))
    assert main(["info", str(tmp_path / "scene.usda")]) == 0
    assert "5 × 3 × 4 nodes" in capsys.readouterr().out


SCALED = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = {unit}
    upAxis = "Z"
)
def Xform "World" (prepend references = @./scene.usda@)
{{
    double3 xformOp:scale = {scale}
    uniform token[] xformOpOrder = ["xformOp:scale"]
}}
"""


@pytest.mark.parametrize(
    ("unit", "scale", "shown"),
    [
        ("1e-6", "(2, 2, 2)", "(2, 2, 2)"),
        ("1e-6", "(1, 1, 2)", "(1, 1, 2)"),
        ("1e-3", "(1, 1, 1)", ""),
        ("1e-3", "(1e-3, 1e-3, 1e-3)", ""),
    ],
)
def test_a_scale_above_a_field_is_refused_unless_it_converts_a_unit(unit, scale, shown, tmp_path, monkeypatch):
    """Places are in metres, so it was ignored. The bead is left out, whose sphere is in the unit of the stage."""
    monkeypatch.chdir(tmp_path)
    npz(tmp_path / "field.npz")
    builder = SceneBuilder(settings=Settings(duration=0.01))
    builder.add(Flow(prim="/World/Flow", kind="grid", file="./field.npz", field=FIELD))
    builder.save(tmp_path / "scene.usda")
    (tmp_path / "above.usda").write_text(SCALED.format(unit=unit, scale=scale))
    if not shown:
        np.testing.assert_allclose(Scene.load(tmp_path / "above.usda").flow.field.velocity, FIELD.velocity)
        exported = export_in_metres(tmp_path / "above.usda", tmp_path / "metres.usda")
        np.testing.assert_allclose(Scene.load(exported).flow.field.high, FIELD.high)
        return
    message = f"/World/Flow: xformOp:scale = {shown}: must be (1, 1, 1) on a velocity field and above it, "
    with pytest.raises(InputError, match=re.escape(message)):
        Scene.load(tmp_path / "above.usda")


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("gone.npz", "ot:flow:file = gone.npz: must be a velocity field; gone.npz: cannot be read"),
        ("", "ot:flow:file = "),
    ],
)
def test_a_stage_without_its_field_is_refused(file, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        stage(tmp_path, file).scene()
