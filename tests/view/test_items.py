from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Body, Scene, SceneBuilder, Sphere
from otwarp.scene.write.edit import StageEditor
from otwarp.view.items import MOST_LISTED, items, picked
from otwarp.view.new_items import KINDS, new_item
from tests.view.runs import SCENE

SCENES = SCENE.parent


def test_every_thing_of_a_scene_can_be_taken_and_a_robot_comes_with_its_traps():
    scene = Scene.load(SCENE)
    found = items(scene)
    kinds = [item.kind for item in found]
    assert [kinds.count(k) for k in ("trap", "robot", "cell", "obstacle", "goal")] == [6, 2, 1, 6, 1]
    assert len({item.label for item in found}) == len(found)
    robot = next(item for item in found if item.kind == "robot")
    holding = [t.prim for t in scene.traps if (t.holds or "").startswith(str(robot.name))]
    assert robot.with_it == (robot.name, *holding) and len(holding) == 3
    instances = [
        item for item in items(Scene.load(SCENES / "microfluidic_channel.usda")) if isinstance(item.name, tuple)
    ]
    assert len(instances) == 200 and instances[17].name[1] == 17


def test_of_many_things_cells_are_left_out_and_nothing_else():
    scene = Scene.load(SCENES / "ten_thousand_cells.usda")
    found = items(scene)
    assert len(found) == MOST_LISTED and {o.prim for o in scene.obstacles} <= {item.name for item in found}


def test_a_ray_takes_what_it_meets_first():
    scene = Scene.load(SCENE)
    found = items(scene)
    down = np.array([0.0, 0.0, -1.0])

    def above(place) -> str | None:
        item = picked(scene, found, np.array([place[0], place[1], 90.0]), down)
        return None if item is None else item.kind

    assert above(scene.bodies[2].position) == "cell"
    assert above(scene.traps[0].position.at(0.0)) == "trap"  # not the sphere around it
    assert scene.goal is not None and above(scene.goal.position) == "goal"
    wall = next(o for o in scene.obstacles if o.shape == "box")
    assert above(wall.position.at(0.0)) == "obstacle"
    assert above((500.0, 0.0)) is None


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "goal"])
def test_new_things_are_put_where_the_click_was(kind: str):
    editor = StageEditor(SCENE)
    item = new_item(kind, editor, (1.0, -2.0, 30.0), 1.5)
    editor.add(item)
    new = next(i for i in items(editor.scene) if i.name == item.prim)
    assert new.kind == kind and new.place == (1.0, -2.0, 30.0)
    with pytest.raises(InputError, match="size = 0 µm: must be above 0"):
        new_item(kind, editor, (1.0, -2.0, 60.0), 0.0)
    editor.close()


def test_an_empty_scene_is_filled(tmp_path: Path):
    editor = StageEditor(SceneBuilder().save(tmp_path / "empty.usda"))
    for n, kind in enumerate(("cell", "trap", "obstacle")):
        editor.add(new_item(kind, editor, (9.0 * n, 0.0, 5.0), 1.0))
    assert [len(found) for found in (editor.scene.bodies, editor.scene.traps, editor.scene.obstacles)] == [1, 1, 1]
    with pytest.raises(InputError, match="nothing can bring it there; must be a scene with a robot"):
        new_item("goal", editor, (0, 0, 5), 1.0)
    ball = Sphere(prim="/World/robot/ball", radius=1.0)
    editor.add(Body(prim="/World/robot", position=(0.0, 9.0, 5.0), spheres=(ball,)))
    editor.add(new_item("goal", editor, (27.0, 0.0, 5.0), 1.0))
    scene = editor.scene
    assert (
        scene.goal is not None and scene.goal.cell == scene.bodies[0].prim and scene.goal.position == (27.0, 0.0, 5.0)
    )
    with pytest.raises(InputError, match="is the goal already"):
        new_item("goal", editor, (0, 0, 5), 1.0)
    assert Scene.load(editor.save(tmp_path / "full.usda")) == scene
    editor.close()
