"""One row of the vocabulary is all that an attribute needs: read, written, checked, declared, and swept per world.

The row is that of a constant force on every body; the tests put it into the table and take it out again.
"""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Body, Scene, SceneBuilder, Sphere, vocabulary
from otwarp.scene.read import attributes
from otwarp.scene.schema import generate
from otwarp.scene.vocabulary import Attribute
from otwarp.scene.vocabulary.attribute import Range
from otwarp.scene.vocabulary.forces import for_cells
from otwarp.scene.vocabulary.values import from_field, to_field
from otwarp.simulation.packing import parameters
from tests.scene.conftest import StageFile

FORCE = Attribute(
    "ot:body:push",
    (0.0, 0.0, 0.0),
    "force",
    "[0, 1e-6]",
    optional=True,
    field="forces.push",
    per_world=("push",),
    doc="Constant force in world coordinates.",
)
SINGLE = dataclasses.replace(FORCE, name="ot:body:wind", field="forces.wind", usd_type="float3", per_world=())
BODY_TEXT = '"Robot" (prepend apiSchemas = ["OtBodyAPI", "PhysicsRigidBodyAPI"])\n    {\n'
CELL_TEXT = '"Cell" (prepend apiSchemas = ["OtCellAPI"])\n    {\n'


@pytest.fixture
def with_force(monkeypatch):
    """The vocabulary with the row in it, for robots and cells."""
    rows = (FORCE, SINGLE)
    longer = {
        "BODY": dataclasses.replace(vocabulary.BODY, attributes=vocabulary.BODY.attributes + rows),
        "CELL": dataclasses.replace(vocabulary.CELL, attributes=vocabulary.CELL.attributes + for_cells(rows)),
    }
    for name, schema in longer.items():
        monkeypatch.setattr(vocabulary, name, schema)
    monkeypatch.setattr(
        attributes, "NAMES", attributes.by_name(vocabulary.SCHEMAS) | attributes.by_name(longer.values())
    )


def authored(text: str, head: str = BODY_TEXT) -> tuple[str, str]:
    return head, f"{head}        {text}\n"


@pytest.mark.usefixtures("with_force")
def test_a_vector_is_read_in_internal_units_where_it_is_authored(stage_file: StageFile) -> None:
    scene = stage_file.load(
        authored("double3 ot:body:push = (1e-12, 0, -2.5e-12)"),
        authored("float3 ot:cell:wind = (0, 0.5e-12, 0)", CELL_TEXT),
    )
    robot, cell = scene.bodies
    assert robot.forces == {"push": (1.0, 0.0, -2.5)}
    assert cell.forces["wind"] == pytest.approx((0.0, 0.5, 0.0), rel=1e-6)  # single precision
    assert all(body.forces == {} for body in stage_file.load().bodies)


@pytest.mark.usefixtures("with_force")
def test_what_the_builder_writes_loads_back_equal_and_says_no_more(tmp_path) -> None:
    body = Body(
        prim="/World/Bead",
        spheres=(Sphere(prim="/World/Bead/Ball", radius=1.5),),
        forces={"push": (0.1, -0.2, 0.3)},
    )
    cell = Body(
        prim="/World/Cell",
        kind="cell",
        position=(9.0, 0.0, 0.0),
        spheres=(Sphere(prim="/World/Cell", radius=3.0),),
        forces={"push": (0.0, 0.0, 7.0)},
    )
    builder = SceneBuilder()
    for item in (body, cell):
        builder.add(item)
    path = builder.save(tmp_path / "scene.usda")
    assert Scene.load(path).bodies == (body, cell)
    assert "double3 ot:body:push = (1e-13, -2e-13, 3e-13)" in path.read_text()
    assert "wind" not in path.read_text()


REFUSED = {
    "double3 ot:body:push = (nan, 0, 0)": "= (nan, 0, 0): must be 3 finite numbers of length in [0, 1e-06] N",
    "double3 ot:body:push = (0, inf, 0)": "= (0, inf, 0): must be 3 finite numbers of length in [0, 1e-06] N",
    "double3 ot:body:push = (0, 8e-7, 8e-7)": "must be 3 finite numbers of length in [0, 1e-06] N",
    "double ot:body:push = 1": "= 1.0 (type double): must be of type double3, 3 finite numbers of length in",
    "double3 ot:body:pus = (0, 0, 0)": "did you mean ot:body:push?",
    "double3 ot:cell:push = (0, 0, 0)": "must be on a prim with OtCellAPI applied",
    "double3 ot:body:push.timeSamples = { 0: (0, 0, 0), 1: (0, 0, 1e-12) }": "must be constant in time",
}


@pytest.mark.usefixtures("with_force")
@pytest.mark.parametrize("text", REFUSED)
def test_a_bad_vector_is_one_line_with_prim_attribute_value_and_range(text: str, stage_file: StageFile) -> None:
    with pytest.raises(InputError) as error:
        stage_file.load(authored(text))
    message = str(error.value)
    assert "\n" not in message
    assert f"{stage_file.folder / 'scene.usda'}: /World/Robot: {text.split()[1].split('.')[0]}" in message
    assert REFUSED[text] in message


@pytest.mark.usefixtures("with_force")
def test_the_schema_and_the_documentation_declare_it() -> None:
    head = "double3 ot:body:push = (0.0, 0.0, 0.0) ("
    doc = "Constant force in world coordinates. Unit: N. Range: 3 finite numbers of length in [0, 1e-06]."
    text = generate._class(vocabulary.BODY)
    assert head in text
    assert doc in text
    assert "| `ot:cell:push` | double3 | N | `(0.0, 0.0, 0.0)` |" in generate._row(vocabulary.CELL.attributes[-2])


@pytest.mark.usefixtures("with_force")
def test_it_may_differ_per_world(monkeypatch, stage_file: StageFile) -> None:
    monkeypatch.setattr(
        parameters, "PARAMETERS", parameters.PARAMETERS | parameters._of_vocabulary(vocabulary.BODY, vocabulary.CELL)
    )
    spec = parameters.PARAMETERS["push"]
    assert (spec.of, spec.width, spec.unit, spec.longest) == ("bodies", 3, "pN", 1e6)
    values = parameters.expand("push", np.ones((5, 1, 3)), worlds=5, traps=1, bodies=2)
    assert values.shape == (5, 2, 3)
    for wrong, message in (
        (np.zeros((4, 2, 3)), "(worlds, 1) or (worlds, bodies) followed by 3 with worlds = 5, bodies = 2"),
        ([0.0, 0.0, 2e6], "has a vector of length 2e+06; allowed: ≤ 1e+06 pN"),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            parameters.expand("push", wrong, worlds=5, traps=1, bodies=2)
    scene = stage_file.load(authored("double3 ot:body:push = (1e-12, 0, 0)"))
    np.testing.assert_array_equal(parameters.scene_values(scene)["push"], [[[1, 0, 0], [0, 0, 0]]])


@pytest.mark.parametrize("schema", vocabulary.SCHEMAS, ids=lambda schema: schema.name)
def test_defaults_survive_the_way_into_the_description_and_back(schema: vocabulary.Schema) -> None:
    for row in schema.attributes:
        if row.usd_type != "rel":
            assert row.allows(row.default)
            assert from_field(row, to_field(row, row.default)) == row.default


@pytest.mark.parametrize(
    ("text", "inside", "outside"),
    [
        ("(0, 10]", [1e-300, 10.0], [0.0, 10.1, math.nan, math.inf]),
        ("[0, inf)", [0.0, 1e300], [-1e-300, math.inf, math.nan]),
        ("[0, inf]", [0.0, math.inf], [-1.0, math.nan, -math.inf]),
        ("(-inf, inf)", [-1e300, 0.0], [math.inf, -math.inf, math.nan]),
    ],
)
def test_a_range_is_read_as_in_mathematics(text: str, inside: list[float], outside: list[float]) -> None:
    assert str(Range(text)) == text
    assert all(value in Range(text) for value in inside)
    assert not any(value in Range(text) for value in outside)
