"""Content hashes of scenes: they stay when the description grows, and change when a scene does."""

import dataclasses

import pytest

from otwarp.scene import Body, Flow, Scene, Settings, Sphere
from otwarp.scene.digest import BEGAN, scene_digest

SCENE = Scene(bodies=(Body(prim="/World/B", kind="robot", spheres=(Sphere(prim="/World/B/S", radius=1.0),)),))

DIGEST = "1174e261f39ac6eaeb21825f4ee59955efd2276b0a027b94528d8d2f0c02f79d"
"""Of `SCENE` since digests began."""


def test_a_digest_is_what_it_was():
    assert scene_digest(SCENE) == DIGEST
    longer = dataclasses.replace(SCENE, settings=Settings(duration=7.0), judged=True)
    assert scene_digest(longer) == DIGEST
    assert scene_digest(dataclasses.replace(SCENE, settings=Settings(period=(0.0, 0.0, 9.0)))) != DIGEST


@pytest.mark.parametrize("name", ["Body", "Settings", "Sphere"])
def test_a_field_of_tomorrow_counts_only_where_it_is_used(name: str):
    """Nobody has to list it: a class of the same name with one more field stands for the class as it will be."""
    today = {"Body": SCENE.bodies[0], "Settings": SCENE.settings, "Sphere": SCENE.bodies[0].spheres[0]}[name]
    fields = [("tomorrow", float, dataclasses.field(default=0.5))]
    wider = dataclasses.make_dataclass(name, fields, bases=(type(today),), frozen=True, kw_only=True)

    def digest(**more: float) -> str:
        item = wider(**{f.name: getattr(today, f.name) for f in dataclasses.fields(today)}, **more)
        body = SCENE.bodies[0]
        if name == "Settings":
            return scene_digest(dataclasses.replace(SCENE, settings=item))
        bodies = (item if name == "Body" else dataclasses.replace(body, spheres=(item,)),)
        return scene_digest(dataclasses.replace(SCENE, bodies=bodies))

    assert digest() == DIGEST
    assert digest(tomorrow=0.75) != DIGEST


def test_a_field_that_was_there_when_digests_began_counts_at_its_default():
    assert set(BEGAN["Flow"]) < {f.name for f in dataclasses.fields(Flow)}
    assert "half_width" not in BEGAN["Flow"]
