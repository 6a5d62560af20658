"""The page on which a scene is drawn: things are added by a click, taken by a click or from a list, dragged, deleted.

One thread does everything; a refused edit is a notification, and the scene stays as it was.
"""

from __future__ import annotations

import math
import queue
import re
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from otwarp.errors import InputError
from otwarp.scene.finding import Finding
from otwarp.scene.write.edit import StageEditor
from otwarp.scene.write.mesh_file import Surface
from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.protocol import Drawing, PageFrame
from otwarp.teleop.page.scene_view import SceneView
from otwarp.view.edit_controls import EditControls
from otwarp.view.items import Item, items, picked
from otwarp.view.measure import on_plane
from otwarp.view.new_items import new_item
from otwarp.view.new_pieces import add_mesh, add_robot, read_mesh
from otwarp.view.remarks import Remarks, as_html
from otwarp.view.scale_bars import ScaleBars
from otwarp.view.source import page_frame
from otwarp.view.theme import Theme

if TYPE_CHECKING:
    import viser

TICK = 0.1
MOST_FAILURES = 5
HANDLE = 0.07
"""Size of the handle over the distance of the camera."""
WIDE = (-1e6, 1e6)
UP = np.array([0.0, 0.0, 1.0])
_NAME = re.compile(r"[\w-][\w .-]*\.usd[ac]?")
KEYS = (
    ("Delete", "delete what is taken"),
    ("Ctrl Z", "undo"),
    ("Escape", "let go; end a path"),
    ("?", "this help"),
)
"""What the help says of the keys."""


class EditPage:
    """A page that edits one scene.

    Args:
        server: viser's, with access guarded.
        editor: The scene.
        out: File that is proposed to be saved; others go into its folder.
        theme: Colours.
    """

    def __init__(self, server: viser.ViserServer, editor: StageEditor, out: Path, theme: Theme):
        self._server, self._editor, self._out, self._theme = server, editor, out, theme
        self._inbox: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._items: list[Item] = []
        self._taken: Item | None = None
        self._placing: str | None = None
        self._path: list[np.ndarray] = []
        self._drawn: list[Any] = []
        self._handle: Any = None
        self._failures, self._begun = 0, False
        self._mesh: Surface | None = None
        self._remarks = Remarks(lambda found: self.post(lambda: self._remarked(found)))
        gui = server.gui
        gui.configure_theme(
            dark_mode=not theme.light,
            show_logo=False,
            show_share_button=False,
            brand_color=(24, 118, 163) if theme.light else (56, 160, 205),
        )
        gui.set_panel_label(f"otwarp · edit {editor.file.stem}")
        gui.main_panel.dock_right()
        self._controls = EditControls(self, server, out.name, _height(editor))
        self._bars = ScaleBars(server, self.post)
        self._draw()

        async def clicked(event: Any) -> None:
            origin, way = np.array(event.ray_origin), np.array(event.ray_direction)
            self.post(lambda: self._click(origin, way))

        server.scene.on_click()(cast("Any", clicked))  # it takes coroutines, too

    def post(self, work: Callable[[], None]) -> None:
        """Have something done by the page's thread."""
        self._inbox.put(work)

    def run(self, stopped: Callable[[], bool]) -> None:
        """Serve until `stopped` says so."""
        try:
            while not stopped():
                try:
                    work = self._inbox.get(timeout=TICK)
                except queue.Empty:
                    continue
                self._do(work)
        finally:
            self._remarks.close()

    def _do(self, work: Callable[[], None]) -> None:
        try:
            work()
        except InputError as error:
            self.tell(str(error), "red")
            self._draw()
        except Exception:
            self._failures += 1
            if self._failures <= MOST_FAILURES:
                traceback.print_exc()

    def place(self, kind: str) -> None:
        """Have the next click put a new thing of a kind: `trap`, `robot`, `cell`, `obstacle` or `goal`."""
        self.let_go()
        self._placing = kind
        self._controls.say(f"click where the {kind} is to be, at the height of {self._controls.height:g} µm")

    def mesh(self, name: str, content: bytes) -> None:
        """Have the next click put a mesh that a window sent."""
        self.let_go()
        self._mesh = read_mesh(name, content, self._controls.unit, self._controls.bounds)
        self._placing = "mesh"
        size = " × ".join(f"{side:.4g}" for side in self._mesh.size)
        mended = "".join(f"; {line}" for line in self._mesh.repairs)
        triangles = len(self._mesh.triangles)
        self._controls.say(f"{name}: {triangles:,} triangles, {size} µm{mended}. Click where its middle is to be")

    def copy(self) -> None:
        """Add a copy of what is taken, and of the traps that hold it, beside it."""
        if self._taken is None or isinstance(self._taken.name, tuple) or self._taken.kind == "goal":
            self.tell("a copy is made of a trap, robot, cell or obstacle with a prim of its own: take one first")
            return
        first, *traps = (str(name) for name in self._taken.with_it)
        way = 2.2 * self._taken.radius
        for by in ((0.0, way, 0.0), (0.0, -way, 0.0), (way, 0.0, 0.0), (-way, 0.0, 0.0)):
            try:  # on one side there may be something
                copies = self._editor.duplicate([first, *traps], by)
                break
            except InputError as error:
                refused = error
        else:
            raise refused
        self._draw()
        self._take(next((item for item in self._items if item.name == copies[0]), None))

    def take(self, label: str) -> None:
        """Take the thing of a label; of another one, let go."""
        self._take(next((item for item in self._items if item.label == label), None))

    def let_go(self) -> None:
        """Nothing is taken, placed or drawn."""
        self._placing, self._path = None, []
        self._clear()
        self._take(None)

    def move_to(self, place: tuple[float, float, float]) -> None:
        """Put what is taken, with the traps that hold it, at a place [µm]."""
        if self._taken is None:
            return
        by = np.subtract(place, self._taken.place)
        if np.abs(by).max() > 1e-9:
            self._editor.move(self._taken.with_it, by.tolist())
            self._draw()

    def delete(self) -> None:
        """Delete what is taken."""
        if self._taken is not None:
            label = self._taken.label
            self._editor.delete(self._taken.name)
            self._taken = None
            self._draw()
            self._controls.say(f"{label} is deleted; undo brings it back")

    def undo(self) -> None:
        """Take the last edit back."""
        self._editor.undo()
        self._draw()

    def begin_path(self) -> None:
        """Have clicks add places to the path of the trap that is taken."""
        if self._taken is None or self._taken.kind != "trap":
            self.tell("a path is drawn for a trap: take one first")
            return
        self._path = [np.array(self._taken.place)]
        self._drop_handle()  # it would take the clicks
        self._controls.say("click on the places of the path, one after the other; then End path")

    def end_path(self) -> None:
        """Give the trap that is taken the path that was drawn."""
        if self._taken is None or len(self._path) < 2:
            self._path = []
            self._take(self._taken)
            return
        places, self._path = self._path[1:], []
        arrives = self._editor.path(str(self._taken.name), [p.tolist() for p in places], self._controls.speed)
        self._draw()
        end = self._editor.scene.settings.duration
        late = f", after the run's end at {end:g} s" if arrives > end else ""
        self._controls.say(f"{self._taken.label if self._taken else 'the trap'} arrives after {arrives:.2f} s{late}")

    def save(self, name: str, replace: bool) -> None:
        """Save into the folder of the proposed file.

        Args:
            name: Of the file.
            replace: Whether one that is there may be replaced.
        """
        if not _NAME.fullmatch(name):
            raise InputError(f"file = {name!r}: must be a plain name that ends with .usda, .usdc or .usd")
        saved = self._editor.save(self._out.parent / name, replace=replace)
        self._controls.say(f"saved as {saved}")
        self.tell(f"saved as {saved}", "green")
        self._say_state()

    def tell(self, line: str, colour: Any = "orange") -> None:
        """Show a line in all windows for a while."""
        for client in self._server.get_clients().values():
            client.add_notification("otwarp", line, auto_close_seconds=8.0, color=colour)

    def _click(self, origin: np.ndarray, way: np.ndarray) -> None:
        if self._path:
            place = on_plane(self._path[0], origin, way, UP)
            self._path.append(place)
            self._show_path()
            return
        if self._placing is not None:
            kind, self._placing = self._placing, None
            height = np.array([0.0, 0.0, self._controls.height])
            place = on_plane(height, origin, way, UP)
            name = self._add(kind, place.tolist())
            self._draw()
            self._take(next((item for item in self._items if item.name == name), None))
            return
        self._take(picked(self._editor.scene, self._items, origin, way))

    def _add(self, kind: str, place: list[float]) -> str:
        """Add a thing of a kind; its path."""
        if kind == "robot":
            return add_robot(self._editor, self._controls.shape, place, self._controls.size)
        if kind == "mesh" and self._mesh is not None:
            return add_mesh(self._editor, self._mesh, place)
        item = new_item(kind, self._editor, place, self._controls.size)
        self._editor.add(item)
        return item.prim

    def _remarked(self, found: Sequence[Finding]) -> None:
        """What `otwarp validate` says of the scene."""
        self._controls.remarks(as_html(found, self._theme.light))

    def _take(self, item: Item | None) -> None:
        self._taken = item
        self._drop_handle()
        self._controls.taken(item)
        if item is None:
            return
        self._handle = self._server.scene.add_transform_controls(
            "/handle",
            scale=HANDLE * self._size,
            line_width=3.0,
            disable_rotations=True,
            depth_test=False,
            position=item.place,
            translation_limits=(WIDE, WIDE, WIDE),
        )
        handle = self._handle

        async def dragged(event: Any) -> None:
            if event.phase == "end":
                x, y, z = (float(v) for v in handle.position)
                self.post(lambda: self.move_to((x, y, z)))

        handle.on_update(dragged)

    def _drop_handle(self) -> None:
        if self._handle is not None:
            self._handle.remove()
            self._handle = None

    def _draw(self) -> None:
        """The scene as it is now, in place of what was drawn."""
        scene = self._editor.scene
        drawing = compose(scene)
        self._items = items(scene)
        camera = drawing.camera
        self._size = math.dist(camera.position, camera.look_at)
        with self._server.atomic():
            self._server.scene.remove_by_name("/scene")
            view = SceneView(self._server, drawing, studio=not self._begun, light=self._theme.light)
            self._begun = True
            view.trap_forces = view.contact_forces = False
            view.update(still(drawing), 0.0)
            self._clear()
            self._paths()
        self._controls.listed([item.label for item in self._items])
        name = self._taken.name if self._taken is not None else None
        self._take(next((item for item in self._items if item.name == name), None) if name is not None else None)
        self._say_state()

    def _paths(self) -> None:
        """Ways of traps and obstacles that move."""
        scene = self._editor.scene
        tracks = [t.position for t in scene.traps] + [o.position for o in scene.obstacles]
        for n, track in enumerate(track for track in tracks if track.animated):
            self._line(f"/paths/{n}", track.values, (255, 201, 89))

    def _show_path(self) -> None:
        """Of a trap, that is being drawn."""
        if len(self._path) > 2:
            self._drawn.pop().remove()
        self._line("/paths/new", np.array(self._path), self._theme.mark)

    def _line(self, name: str, places: np.ndarray, colour: tuple[int, int, int]) -> None:
        segments = np.stack([places[:-1], places[1:]], axis=1).astype(np.float32)
        line = self._server.scene.add_line_segments(
            name, segments, np.array(colour), thickness=2.5, thickness_units="screen"
        )
        self._drawn.append(line)

    def _clear(self) -> None:
        for handle in self._drawn:
            handle.remove()
        self._drawn = []

    def _say_state(self) -> None:
        scene = self._editor.scene
        robots = sum(body.kind == "robot" for body in scene.bodies)
        counts = {
            "trap": len(scene.traps),
            "robot": robots,
            "cell": len(scene.bodies) - robots,
            "obstacle": len(scene.obstacles),
            "goal": int(scene.goal is not None),
        }
        words = ", ".join(f"{n} {kind}{'' if n == 1 else 's'}" for kind, n in counts.items() if n)
        saved = "saved" if self._editor.saved else "not saved"
        self._remarks.ask(scene)
        self._controls.state(f"{words or 'empty'} · {saved}", self._editor.undoable)


def still(drawing: Drawing) -> PageFrame:
    """The moment at which a scene begins, without forces."""
    traps, many = len(drawing.traps), len(drawing.position)
    return page_frame(
        0,
        0.0,
        {
            "position": drawing.position,
            "orientation": drawing.orientation,
            "trap_position": np.array([t.position for t in drawing.traps]).reshape(-1, 3),
            "trap_power": np.array([t.power for t in drawing.traps]),
            "trap_force": np.zeros((traps, 3)),
            "trap_distance": np.zeros(traps),
            "contact_force": np.zeros((many, 3)),
            "contact_load": np.zeros(many),
        },
    )


def _height(editor: StageEditor) -> float:
    """Height at which new things are put: that of most bodies, or of the traps."""
    scene = editor.scene
    heights = [b.position[2] for b in scene.bodies] or [float(t.position.at(0.0)[2]) for t in scene.traps]
    return round(float(np.median(heights)), 3) if heights else 5.0
