"""`otwarp edit` as a user has it: things added, dragged, led along a path, deleted, undone and saved in a browser."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from otwarp.scene import Scene
from otwarp.teleop.page.compose import compose
from otwarp.view.edit_page import HANDLE
from tests.teleop.page.browser import ARTIFACTS, browser, pixel
from tests.view.runs import SCENE
from tests.view.test_browser import PATIENCE, WIDE, accessible, page_of
from tests.view.test_new_pieces import tetrahedron

pytest.importorskip("viser")

HEIGHT = 30.0
"""At which things are put: above everything [µm]."""
NEAR = 0.6
"""By which a click may miss a place [µm]: a pixel is a tenth of that, and the view is slanted."""


def fill(window: Any, label: str, value: str) -> None:
    """Type into a field of the panel."""
    field = window.get_by_role("textbox", name=label).first
    field.fill(value)
    field.press("Enter")


def drag(window: Any, start: tuple[float, float]) -> None:
    """Drag to the right from a pixel, no faster than the page follows."""
    window.mouse.move(*start)
    window.wait_for_timeout(1000)
    window.mouse.down()
    for k in range(1, 6):
        window.mouse.move(start[0] + 8.0 * k, start[1])
        window.wait_for_timeout(250)
    window.mouse.up()


def save_once(window: Any, out: Path) -> bytes:
    """Save; a second time, and elsewhere, is refused. What was written."""
    window.get_by_role("button", name="Save").click()
    window.get_by_text("saved as").first.wait_for(timeout=PATIENCE)
    saved = out.read_bytes()
    window.get_by_role("button", name="Save").click()
    window.get_by_text("must be a new file, or one that may be replaced").wait_for(timeout=PATIENCE)
    fill(window, "File", "../elsewhere.usda")
    window.get_by_role("button", name="Save").click()
    window.get_by_text("must be a plain name").wait_for(timeout=PATIENCE)
    return saved


def test_a_scene_is_drawn_and_saved(tmp_path: Path):
    before, out = Scene.load(SCENE), tmp_path / "drawn.usda"
    text = SCENE.read_bytes()
    camera = compose(before).camera
    with browser() as engine, page_of("edit", str(SCENE), "-o", str(out)) as url:
        window = engine.new_page(viewport=WIDE)
        errors: list[str] = []
        window.on("pageerror", lambda error: errors.append(str(error)))
        window.goto(url)
        window.locator("canvas[data-engine]").wait_for(timeout=PATIENCE)
        window.get_by_text("6 traps, 2 robots, 1 cell, 6 obstacles, 1 goal · saved").wait_for(timeout=PATIENCE)
        box = window.locator("canvas[data-engine]").bounding_box()

        def click(place: tuple[float, float, float]) -> None:
            """On a place of the scene."""
            window.mouse.click(*pixel(camera, place, box))

        def note(words: str) -> None:
            """Wait for what the page says over the picture."""
            window.locator("#otwarp-note").get_by_text(words).wait_for(timeout=PATIENCE / 4)

        fill(window, "Height [µm]", str(HEIGHT))
        for n, (kind, x) in enumerate((("cell", -8.0), ("trap", 16.0), ("obstacle", 0.0))):
            window.get_by_role("button", name=kind, exact=True).click()
            note(f"click where the {kind} is to be")
            click((x, 0.0, HEIGHT))
            note(f"{kind}_1: drag its handle")
            window.get_by_role("button", name=f"Undo ({n + 1})").wait_for(timeout=PATIENCE)
        size = float(np.linalg.norm(np.subtract(camera.position, camera.look_at)))
        drag(window, pixel(camera, (0.7 * HANDLE * size, 0.0, HEIGHT), box))  # the red arrow of the obstacle's handle
        window.get_by_role("button", name="Undo (4)").wait_for(timeout=PATIENCE)

        click((16.0, 0.0, HEIGHT))
        note("trap_1: drag its handle")
        window.get_by_role("button", name="Draw path").click()
        note("click on the places of the path")
        for place in ((16.0, 6.0, HEIGHT), (10.0, 10.0, HEIGHT)):
            click(place)
            window.wait_for_timeout(1000)
        window.get_by_role("button", name="End path").click()
        note("trap_1 arrives after")
        click((-8.0, 0.0, HEIGHT))
        note("cell_1: drag its handle")
        window.keyboard.press("Delete")
        window.get_by_text(re.compile("7 traps, 2 robots, 1 cell, 7 obstacles")).wait_for(timeout=PATIENCE)
        window.keyboard.press("Control+z")
        window.get_by_text(re.compile("7 traps, 2 robots, 2 cells, 7 obstacles")).wait_for(timeout=PATIENCE)
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        window.screenshot(path=ARTIFACTS / "edit.png")
        assert accessible(window)

        saved = save_once(window, out)
        assert errors == []
    assert out.read_bytes() == saved and SCENE.read_bytes() == text
    assert [p.name for p in tmp_path.iterdir()] == ["drawn.usda"]
    check(Scene.load(out), before)


def test_a_robot_and_a_mesh_are_added_and_remarked_on(tmp_path: Path):
    pytest.importorskip("trimesh")
    before, out, part = Scene.load(SCENE), tmp_path / "drawn.usda", tmp_path / "part.stl"
    part.write_bytes(tetrahedron())
    camera = compose(before).camera
    with browser() as engine, page_of("edit", str(SCENE), "-o", str(out)) as url:
        window = engine.new_page(viewport={"width": 1280, "height": 1000})
        errors: list[str] = []
        window.on("pageerror", lambda error: errors.append(str(error)))
        window.goto(url)
        window.locator("canvas[data-engine]").wait_for(timeout=PATIENCE)
        window.get_by_text("nothing: it would run as it is").wait_for(timeout=PATIENCE)
        box = window.locator("canvas[data-engine]").bounding_box()
        note = window.locator("#otwarp-note")
        fill(window, "Height [µm]", str(HEIGHT))
        fill(window, "Size [µm]", "2")
        window.get_by_role("button", name="robot", exact=True).click()
        note.get_by_text("click where the robot is to be").wait_for(timeout=PATIENCE)
        window.mouse.click(*pixel(camera, (-10.0, 0.0, HEIGHT), box))
        note.get_by_text("robot_1: drag its handle, with 2 traps").wait_for(timeout=PATIENCE)
        window.get_by_role("button", name="Copy").click()
        window.get_by_role("button", name="Undo (2)").wait_for(timeout=PATIENCE)
        window.get_by_text("Mesh", exact=True).click()
        fill(window, "Unit [µm]", "6")
        with window.expect_file_chooser() as chooser:
            window.get_by_role("button", name="Import STL, OBJ, PLY").click()
        chooser.value.set_files(part)
        note.get_by_text("part.stl: 4 triangles, 6 × 6 × 6 µm").wait_for(timeout=PATIENCE)
        window.mouse.click(*pixel(camera, (12.0, 0.0, HEIGHT), box))
        note.get_by_text("mesh_1").wait_for(timeout=PATIENCE)
        window.get_by_text(re.compile("10 traps, 4 robots, 1 cell, 7 obstacles")).wait_for(timeout=PATIENCE)
        window.get_by_role("button", name="trap", exact=True).click()
        note.get_by_text("click where the trap is to be").wait_for(timeout=PATIENCE)
        window.mouse.click(*pixel(camera, (0.0, 10.0, HEIGHT), box))
        window.locator("[data-remarks]").get_by_text("no sphere is within its reach").wait_for(timeout=PATIENCE)
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        window.evaluate("document.querySelectorAll('.mantine-Notification-root').forEach((e) => e.remove())")
        window.screenshot(path=ARTIFACTS / "edit_pieces.png")
        assert accessible(window)
        window.keyboard.press("Control+z")
        window.get_by_text("nothing: it would run as it is").wait_for(timeout=PATIENCE)
        window.get_by_role("button", name="Save").click()
        window.get_by_text("saved as").first.wait_for(timeout=PATIENCE)
        assert errors == []
    drawn = Scene.load(out)
    robots = [body for body in drawn.bodies if "robot_1" in body.prim]
    assert [len(body.spheres) for body in robots] == [2, 2]
    assert robots[0].position == pytest.approx((-10.0, 0.0, HEIGHT), abs=NEAR)
    assert drawn.obstacles[-1].shape == "mesh" and drawn.obstacles[:-1] == before.obstacles
    assert [body for body in drawn.bodies if body not in robots] == list(before.bodies)


def check(drawn: Scene, before: Scene) -> None:
    """What was drawn stands where it was clicked, and all else where it was."""
    assert drawn.bodies[:-1] == before.bodies and drawn.traps[:-1] == before.traps
    assert drawn.obstacles[:-1] == before.obstacles and drawn.goal == before.goal
    cell, trap, box = drawn.bodies[-1], drawn.traps[-1], drawn.obstacles[-1]
    assert cell.position == pytest.approx((-8.0, 0.0, HEIGHT), abs=NEAR)
    track = trap.position
    assert track.values[:3] == pytest.approx(np.array([(16, 0, HEIGHT), (16, 6, HEIGHT), (10, 10, HEIGHT)]), abs=NEAR)
    ways = np.linalg.norm(np.diff(track.values[:3], axis=0), axis=1)
    assert np.diff(track.times[:3]) == pytest.approx(ways / 5.0)
    x, y, z = box.position.at(0.0)
    assert x > 2.0 and (y, z) == pytest.approx((0.0, HEIGHT), abs=NEAR)
