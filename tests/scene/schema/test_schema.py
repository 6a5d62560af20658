"""The schema files, the documentation and the description follow the one table, and USD knows the schemas."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys

import pytest

from otwarp.scene import SCHEMA_FOLDER, description, vocabulary
from otwarp.scene.schema.generate import DOCS, documentation, generated_files
from otwarp.scene.vocabulary import SCHEMAS
from otwarp.units import FROM_SI
from tests.scene.conftest import StageFile

FIELDS = {
    "OtSceneAPI": (description.Medium, description.Settings),
    "OtTrapAPI": (description.Trap,),
    "OtTrapLawAPI": (description.TrapLaw,),
    "OtBodyAPI": (description.Body, description.Material),
    "OtSphereAPI": (description.Sphere,),
    "OtRodAPI": (description.Rod,),
    "OtCellAPI": (description.Body, description.Material, description.Sphere),
    "OtObstacleAPI": (description.Obstacle,),
    "OtFlowAPI": (description.Flow,),
    "OtCameraAPI": (description.Camera,),
    "OtGoalAPI": (description.Goal,),
}


def python(code: str, **environment: str) -> str:
    """Standard output of a fresh interpreter; anything on stderr fails."""
    clean = {name: value for name, value in os.environ.items() if name != "PXR_PLUGINPATH_NAME"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env=clean | environment
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


@pytest.mark.parametrize("path", generated_files(), ids=lambda path: path.name)
def test_files_follow_the_table(path) -> None:
    assert path.read_text(encoding="utf-8") == generated_files()[path], "run python -m otwarp.scene.schema"


def test_documentation_has_every_attribute() -> None:
    text = DOCS.read_text(encoding="utf-8")
    for schema in SCHEMAS:
        assert f"### {schema.name}" in text
        for attribute in schema.attributes:
            assert f"| `{attribute.name}` |" in text


@pytest.mark.parametrize("schema", SCHEMAS, ids=lambda schema: schema.name)
def test_fields_and_dimensions_exist(schema: vocabulary.Schema) -> None:
    known = {field.name for kind in FIELDS[schema.name] for field in dataclasses.fields(kind)}
    for attribute in schema.attributes:
        assert attribute.dimension in FROM_SI
        part, _, last = attribute.field.rpartition(".")
        assert part == "forces" or last in known | {"length_unit", "force_unit"}


def test_usd_knows_name_type_default_and_documentation() -> None:
    from pxr import Usd

    registry = Usd.SchemaRegistry()
    for schema in SCHEMAS:
        definition = registry.FindAppliedAPIPrimDefinition(schema.name)
        assert definition.GetDocumentation() == schema.doc
        assert set(definition.GetPropertyNames()) == {attribute.name for attribute in schema.attributes}
        for attribute in schema.attributes:
            assert definition.GetPropertyDocumentation(attribute.name) == documentation(attribute)
            if attribute.usd_type == "rel":
                continue
            found = definition.GetAttributeDefinition(attribute.name)
            assert found.GetTypeName() == attribute.usd_type
            value = found.GetFallbackValue()
            assert (tuple(value) if attribute.usd_type == "double[]" else value) == attribute.default
            assert tuple(found.GetMetadata("allowedTokens") or ()) == attribute.allowed


def test_documentation_ends_with_unit_and_range() -> None:
    power = next(a for a in vocabulary.TRAP.attributes if a.name == "ot:trap:power")
    assert documentation(power).endswith("Unit: W. Range: [0, 10].")


def test_plugin_path_alone_makes_the_schemas_known() -> None:
    code = """
import sys
from pxr import Usd
stage = Usd.Stage.CreateInMemory()
prim = stage.DefinePrim("/Trap", "Xform")
prim.ApplyAPI("OtTrapAPI")
print(prim.GetAttribute("ot:trap:power").Get(), prim.CanApplyAPI("OtTrapLawAPI", "radial")[0], "otwarp" in sys.modules)
"""
    assert python(code, PXR_PLUGINPATH_NAME=str(SCHEMA_FOLDER)) == "0.02 True False"


@pytest.mark.parametrize("first", ["import otwarp.scene", "from pxr import Usd\nimport otwarp.scene"])
def test_importing_the_package_makes_them_known(first: str) -> None:
    code = first + '\nfrom pxr import Usd\nprint(bool(Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("OtTrapAPI")))'
    assert python(code) == "True"


def test_description_loads_no_usd() -> None:
    assert python('import sys, otwarp.scene.description\nprint("pxr" in sys.modules)') == "False"


def test_same_scene_when_the_registry_was_built_before(stage_file: StageFile) -> None:
    from otwarp.scene import Scene, SceneBuilder, Trap

    path = stage_file.write()
    scene = Scene.load(path)
    code = f"""
from pathlib import Path
from pxr import Usd
registry = Usd.SchemaRegistry()
registry.FindAppliedAPIPrimDefinition("CollectionAPI")
from otwarp.errors import InputError
from otwarp.scene import Scene, SceneBuilder
assert registry.FindAppliedAPIPrimDefinition("OtTrapAPI") is None
scene = Scene.load({str(path)!r})
builder = SceneBuilder(medium=scene.medium, settings=scene.settings)
for item in (*scene.bodies, *scene.traps):
    builder.add(item)
builder.save({str(stage_file.folder / "late.usda")!r})
text = Path({str(path)!r}).read_text().replace("trap:power", "trap:powr")
Path({str(path)!r}).with_name("bad.usda").write_text(text)
try:
    Scene.load({str(stage_file.folder / "bad.usda")!r})
except InputError as error:
    print("did you mean ot:trap:power?" in str(error))
print(repr(scene))
"""
    refused, text = python(code).split("\n", 1)
    assert refused == "True"
    assert text == repr(scene)

    builder = SceneBuilder(medium=scene.medium, settings=scene.settings)
    for item in (*scene.bodies, *scene.traps):
        builder.add(item)
    early = builder.save(stage_file.folder / "early.usda")
    assert isinstance(scene.traps[0], Trap)
    assert (stage_file.folder / "late.usda").read_text() == early.read_text()


def test_the_example_of_the_documentation_runs(tmp_path, monkeypatch) -> None:
    from otwarp.scene import Scene

    monkeypatch.chdir(tmp_path)
    code = DOCS.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    exec(compile(code, str(DOCS), "exec"), names := {})
    assert Scene.load(tmp_path / "bead.usda") == names["builder"].scene()
