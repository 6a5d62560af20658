"""The scene of a study is that of its file: one that was changed in Python is refused, with what to do instead."""

from __future__ import annotations

from dataclasses import replace

import pytest

from otwarp.errors import InputError
from otwarp.scene import Scene, SceneBuilder
from otwarp.studies.axes import values
from otwarp.studies.engines.run import run_study
from otwarp.studies.observables import first_passage, trapped
from otwarp.studies.rare.study import EscapeStudy
from otwarp.studies.stopping.rules import trials
from otwarp.studies.study import Study
from tests.studies.scenes import bead_in_a_well

pytest.importorskip("zarr")

AXES = {
    "none": {},
    "parameter": {"trap_power": values([0.4], unit="mW")},
    "attribute": {"/World/bead/sphere.radius": values([0.4], unit="µm")},
}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


def study_of(scene: Scene, *, axes=AXES["parameter"], **how) -> Study:
    return Study(scene, axes=axes, **({"observables": [trapped(until=0.004)], "stop": trials(4), "seed": 3} | how))


@pytest.mark.parametrize("axes", AXES.values(), ids=AXES)
def test_a_scene_that_is_not_its_file(file, axes):
    """Whatever varies: the folder keeps the file, so what was simulated would not be what it holds."""
    loaded = Scene.load(file)
    thick, still = replace(loaded.medium, viscosity=0.002), replace(loaded.settings, brownian=False)
    for changed, said in (
        (replace(loaded, medium=thick), r"medium\.viscosity is 0\.00089 there, 0\.002 now"),
        (replace(loaded, traps=()), r"traps \(its length\) is 1 there, 0 now"),
        (replace(loaded, settings=still), r"settings\.brownian is true there, false now"),
    ):
        for make in (study_of, EscapeStudy):
            with pytest.raises(InputError, match=f"is not that of its file .*well.usda: {said}; allowed: as it was"):
                make(changed, axes=axes)


@pytest.mark.thorough
def test_a_changed_scene_that_was_saved(file, tmp_path):
    """As the message says: the folder holds the scene that was meant, and goes on with it."""
    loaded = Scene.load(file)
    builder = SceneBuilder(settings=loaded.settings, medium=replace(loaded.medium, viscosity=0.002))
    for item in (*loaded.bodies, *loaded.traps):
        builder.add(item)
    saved = Scene.load(builder.save(tmp_path / "thick.usda"))
    store = run_study(study_of(saved), tmp_path / "out", devices=["cpu"])
    assert Scene.load(store.scene) == saved
    run_study(study_of(saved), tmp_path / "out", devices=["cpu"])


def test_a_scene_that_is_loaded_for_a_longer_run(file, tmp_path):
    """How long a run is may be said while loading, the horizon where no other is given; models of groups are made from
    the file, and last as long as that says."""
    longer = Scene.load(file, duration=2.0 * Scene.load(file).settings.duration)
    for _ in range(2):
        store = run_study(study_of(longer, observables=[first_passage()]), tmp_path / "out", devices=["cpu"])
    assert store.asked()["horizon"] == longer.settings.duration
    with pytest.raises(InputError, match=r"settings\.duration is 0\.5 there, 1\.0 now"):
        study_of(longer, axes=AXES["attribute"])
