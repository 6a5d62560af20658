"""A scene that is edited: what is added, moved, deleted and undone loads as expected, and its file stays as it is."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from otwarp.errors import InputError
from otwarp.scene import Body, Obstacle, Scene, SceneBuilder, Sphere, Track, Trap, TrapLaw
from otwarp.scene.write.edit import StageEditor

SCENES = Path(__file__).resolve().parents[3] / "scenes"
SMALL = SCENES / "teleop_small.usda"
WAY = (0.0, 0.0, 20.0)
"""To where nothing is [µm]."""


@pytest.fixture
def editor() -> Iterator[StageEditor]:
    found = StageEditor(SMALL)
    yield found
    found.close()


def cell(path: str, place: tuple[float, float, float] = (0.0, 0.0, 20.0)) -> Body:
    return Body(prim=path, kind="cell", position=place, spheres=(Sphere(prim=path, radius=2.0, trapped=False),))


@pytest.mark.quick
def test_what_is_added_is_there_and_all_else_is_as_it_was(editor: StageEditor):
    before = editor.scene
    assert before == Scene.load(SMALL) and editor.saved
    trap = dataclasses.replace(before.traps[0], prim="/World/new/trap", position=Track.constant((1, 2, 3)), holds=None)
    box = Obstacle(
        prim="/World/box", shape="box", position=Track.constant((0, 9, 30)), orientation=Track.constant((0, 0, 0, 1)),
        size=(1.0, 2.0, 3.0),
    )  # fmt: skip
    for item in (cell("/World/extra"), trap, box):
        editor.add(item)
    now = editor.scene
    assert now.bodies == (*before.bodies, cell("/World/extra"))
    assert now.traps == (*before.traps, trap) and now.obstacles == (*before.obstacles, box)
    assert dataclasses.replace(now, bodies=before.bodies, traps=before.traps, obstacles=before.obstacles) == before
    with pytest.raises(InputError, match="/World/extra: path is taken"):
        editor.add(cell("/World/extra"))
    assert editor.free_path("extra") == "/World/extra_1"


@pytest.mark.quick
def test_edits_are_undone_in_turn(editor: StageEditor):
    states = [editor.scene]
    editor.add(cell("/World/extra"))
    states.append(editor.scene)
    editor.move(["/World/extra", "/World/cell"], (1.0, -2.0, 0.5))
    states.append(editor.scene)
    editor.path(editor.scene.traps[0].prim, [(0.0, 0.0, 9.0)], 2.0)
    for wanted in reversed(states):
        assert editor.scene != wanted
        editor.undo()
        assert editor.scene == wanted
    editor.undo()
    assert editor.scene == states[0] and editor.undoable == 0


def test_things_are_moved_wherever_their_place_is_written(tmp_path: Path):
    """Below a turned parent, along time samples, and as an instance."""
    editor = StageEditor(SCENES / "cell_delivery.usda")
    before, way = editor.scene, np.array([0.5, -1.0, 0.25])
    moving = next(o for o in before.obstacles if o.position.animated)
    names = [before.traps[0].prim, *(b.prim for b in before.bodies), moving.prim]
    editor.move(names, way.tolist())
    assert editor.scene.traps[0].position.values == pytest.approx(before.traps[0].position.values + way, abs=1e-8)
    assert editor.scene.bodies[0].position == pytest.approx(np.add(before.bodies[0].position, way), abs=1e-8)
    now = next(o for o in editor.scene.obstacles if o.prim == moving.prim)
    assert now.position.values == pytest.approx(moving.position.values + way, abs=1e-8)
    editor.close()

    editor = StageEditor(SCENES / "microfluidic_channel.usda")
    before = editor.scene
    which = next(b for b in before.bodies if b.instance == 17)
    editor.move([(which.prim, 17)], way.tolist())
    for old, new in zip(before.bodies, editor.scene.bodies, strict=True):
        moved = way if (old.prim, old.instance) == (which.prim, 17) else 0.0
        # instances have places in single precision
        assert new.position == pytest.approx(np.array(old.position) + moved, abs=1e-5)
    editor.delete((which.prim, 17))
    assert len(editor.scene.bodies) == len(before.bodies) - 1
    editor.close()


def test_a_path_takes_a_trap_through_its_places(editor: StageEditor):
    trap = editor.scene.traps[2]
    start = trap.position.at(0.0)
    places = [np.add(start, way).tolist() for way in ((3.0, 4.0, 0.0), (3.0, 4.0, 12.0))]
    assert editor.path(trap.prim, places, 2.0) == pytest.approx(8.5)
    track = editor.scene.traps[2].position
    assert track.times == pytest.approx([0.0, 2.5, 8.5, 10.0])  # it stays there until the run ends
    assert track.values == pytest.approx(np.vstack([start, places, places[-1]]))
    with pytest.raises(InputError, match="two places after each other must differ"):
        editor.path(trap.prim, [places[0], places[0]], 2.0)
    for speed in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="must be above 0"):
            editor.path(trap.prim, places, speed)
    with pytest.raises(InputError, match="must be a trap's, with one place or more"):
        editor.path(trap.prim, [], 1.0)


def test_what_is_deleted_is_gone_and_traps_let_go_of_it(editor: StageEditor, tmp_path: Path):
    robot = editor.scene.bodies[0]
    with pytest.raises(InputError, match="ot:goal:robots"):
        editor.delete(robot.prim)  # the goal names it
    assert editor.scene == Scene.load(SMALL) and editor.undoable == 0
    assert editor.scene.goal is not None
    holding = [t for t in editor.scene.traps if (t.holds or "").startswith(robot.prim)]
    editor.delete(editor.scene.goal.prim)
    editor.delete(robot.prim)
    assert robot.prim not in [b.prim for b in editor.scene.bodies] and editor.scene.goal is None
    assert holding and all(t.holds is None for t in editor.scene.traps if t.prim in [h.prim for h in holding])
    assert Scene.load(editor.save(tmp_path / "less.usda")) == editor.scene


@pytest.mark.parametrize("scene", ["teleop_small", "microfluidic_channel", "strategy_b"])
def test_what_is_saved_loads_as_it_was_shown(scene: str, tmp_path: Path):
    file = SCENES / f"{scene}.usda"
    text = file.read_bytes()
    editor = StageEditor(file)
    last = editor.scene.bodies[-1]
    editor.add(dataclasses.replace(editor.scene.traps[0], prim="/World/extra", holds=None))
    editor.move(["/World/extra"], last.position)
    assert not editor.saved
    saved = editor.save(tmp_path / "new.usda")
    assert editor.saved and Scene.load(saved) == editor.scene and Scene.load(saved) != Scene.load(file)
    assert file.read_bytes() == text
    with pytest.raises(InputError, match="is there; must be a new file, or one that may be replaced"):
        editor.save(saved)
    editor.undo()
    editor.undo()
    assert Scene.load(editor.save(saved, replace=True)) == Scene.load(file)
    with pytest.raises(InputError, match=r"must be one of \.usda"):
        editor.save(tmp_path / "new.stl")
    with pytest.raises(InputError, match="writable folder"):
        editor.save(tmp_path / "nowhere" / "new.usda")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["new.usda"]
    editor.close()


def test_references_are_found_from_another_folder(tmp_path: Path):
    """The scene refers to a body in a file beside it; it is saved elsewhere."""
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    builder = SceneBuilder(root="/Part")
    sphere = Sphere(prim="/Part/bead/ball", radius=1.0)
    builder.add(Body(prim="/Part/bead", spheres=(sphere,)))
    builder.save(tmp_path / "a" / "part.usda")
    law = TrapLaw(stiffness=1.0)
    world = SceneBuilder()
    world.add(
        Trap(
            prim="/World/t", position=Track.constant((0, 0, 5)), power=Track.constant(1.0), model="harmonic", radial=law
        )
    )
    bead = world.stage.DefinePrim("/World/bead", "Xform")
    bead.GetReferences().AddReference("./part.usda", "/Part/bead")
    file = tmp_path / "a" / "scene.usda"
    world.stage.GetRootLayer().Export(str(file))
    editor = StageEditor(file)
    editor.move(["/World/bead"], (1.0, 0.0, 0.0))
    saved = editor.save(tmp_path / "b" / "scene.usda")
    assert "../a/part.usda" in saved.read_text() and Scene.load(saved) == editor.scene
    assert editor.scene.bodies[0].position == (1.0, 0.0, 0.0)
    editor.close()


@pytest.mark.quick
def test_scenes_that_cannot_be_edited_are_refused(tmp_path: Path):
    text = SMALL.read_text()
    metres = tmp_path / "metres.usda"
    metres.write_text(text.replace("metersPerUnit = 0.000001", "metersPerUnit = 0.00001"))
    with pytest.raises(InputError, match="metersPerUnit = 1e-05: must be 1e-06"):
        StageEditor(metres)
    with pytest.raises(InputError, match="no such file"):
        StageEditor(tmp_path / "nothing.usda")


def test_a_copy_has_all_of_its_original_and_its_traps_hold_it(editor: StageEditor, tmp_path: Path):
    before, robot = editor.scene, editor.scene.bodies[0]
    holding = [t for t in before.traps if (t.holds or "").startswith(f"{robot.prim}/")]
    copies = editor.duplicate([robot.prim, *(t.prim for t in holding)], WAY)
    assert copies[0] == f"{robot.prim}_copy_1" and editor.undoable == 1
    now = {body.prim: body for body in editor.scene.bodies}
    copy = now[copies[0]]
    assert copy.position == pytest.approx(np.add(robot.position, WAY))
    assert [(s.offset, s.radius, s.trapped) for s in copy.spheres] == [
        (s.offset, s.radius, s.trapped) for s in robot.spheres
    ]
    traps = {t.prim: t for t in editor.scene.traps}
    for old, name in zip(holding, copies[1:], strict=True):
        new = traps[name]
        assert new.holds == old.holds.replace(robot.prim, copy.prim) and new.hand == "none"
        assert new.position.at(0.0) == pytest.approx(np.add(old.position.at(0.0), WAY))
    assert editor.duplicate([robot.prim], (0.0, 0.0, 40.0)) == [f"{robot.prim}_copy_2"]
    assert Scene.load(editor.save(tmp_path / "more.usda")) == editor.scene


def test_what_otwarp_does_not_know_stays_in_the_file(tmp_path: Path):
    own = tmp_path / "own.usda"
    foreign = 'def Xform "Notes"\n{\n    custom string author = "me"\n    custom double tracked.timeSamples = {\n'
    foreign += "        0: 1,\n        7: 2,\n    }\n}\n"
    head, mark, rest = SMALL.read_text().partition('def Xform "World"')
    own.write_text(head + foreign + mark + rest)
    editor = StageEditor(own)
    before = editor.scene
    editor.add(cell("/World/extra"))
    saved = Usd.Stage.Open(str(editor.save(tmp_path / "more.usda")))
    editor.close()
    notes = saved.GetPrimAtPath("/Notes")
    assert notes.GetAttribute("author").Get() == "me"
    assert notes.GetAttribute("tracked").GetTimeSamples() == [0.0, 7.0]
    original = Usd.Stage.Open(str(own))
    for prim in original.Traverse():
        there = saved.GetPrimAtPath(prim.GetPath())
        assert there and there.GetTypeName() == prim.GetTypeName()
        assert {a.GetName() for a in prim.GetAuthoredProperties()} <= {
            a.GetName() for a in there.GetAuthoredProperties()
        }
    for field in ("metersPerUnit", "upAxis", "framesPerSecond", "timeCodesPerSecond", "startTimeCode", "endTimeCode"):
        assert saved.GetMetadata(field) == original.GetMetadata(field), field
    assert Scene.load(tmp_path / "more.usda").bodies[:-1] == before.bodies
