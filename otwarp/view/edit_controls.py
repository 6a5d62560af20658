"""Buttons, fields and keys of the page on which a scene is drawn."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from otwarp.teleop.page.front import overlay
from otwarp.view.items import Item
from otwarp.view.new_items import KINDS
from otwarp.view.new_pieces import ROBOTS

if TYPE_CHECKING:
    import viser

NOTHING = "nothing"
"""In the list of things: none is taken."""
SIZE, SPEED = 3.0, 5.0
"""Of new things [µm], and of paths [µm/s], until a user says otherwise."""


class Edited(Protocol):
    """What the controls need of a page."""

    def post(self, work: Callable[[], None]) -> None:
        """Have something done by the page's thread."""
        ...

    def place(self, kind: str) -> None:
        """Have the next click put a new thing."""
        ...

    def mesh(self, name: str, content: bytes) -> None:
        """Have the next click put a mesh."""
        ...

    def copy(self) -> None:
        """Add a copy of what is taken."""
        ...

    def take(self, label: str) -> None:
        """Take the thing of a label."""
        ...

    def let_go(self) -> None:
        """Nothing is taken."""
        ...

    def move_to(self, place: tuple[float, float, float]) -> None:
        """Put what is taken at a place."""
        ...

    def delete(self) -> None:
        """Delete what is taken."""
        ...

    def undo(self) -> None:
        """Take the last edit back."""
        ...

    def begin_path(self) -> None:
        """Have clicks add places to a path."""
        ...

    def end_path(self) -> None:
        """Give the trap its path."""
        ...

    def save(self, name: str, replace: bool) -> None:
        """Save as a file."""
        ...


class EditControls:
    """The panel; callbacks only `post` work to the page's thread.

    Args:
        page: What they control.
        server: Of viser.
        name: File that is proposed to be saved.
        height: At which new things are put [µm].
    """

    def __init__(self, page: Edited, server: viser.ViserServer, name: str, height: float):
        self._page, self._gui = page, server.gui
        gui = self._gui
        self._state = gui.add_html("")
        self._note = gui.add_html("")
        with gui.add_folder("Add"):
            kinds = gui.add_button_group("Thing", (*KINDS, "robot"))

            async def chosen(_: Any) -> None:
                kind = kinds.value
                page.post(lambda: page.place(kind))

            kinds.on_click(chosen)
            self._height = gui.add_number("Height [µm]", height, hint="z of what is added by a click")
            self._size = gui.add_number(
                "Size [µm]",
                SIZE,
                min=0.01,
                hint="Radius of a cell, a goal or a robot's spheres, half side of an obstacle",
            )
            self._shape = gui.add_dropdown("Robot", tuple(ROBOTS), initial_value=next(iter(ROBOTS)), hint="Its spheres")
            self._mesh()
        with gui.add_folder("Remarks"):
            self._remarks = gui.add_html("")
        with gui.add_folder("Taken"):
            self._list: Any = gui.add_dropdown("Thing", (NOTHING,), initial_value=NOTHING)
            self._changed(self._list, lambda label: page.take(label))
            self._place = gui.add_vector3("Place [µm]", (0.0, 0.0, 0.0), disabled=True, hint="Of its prim")
            self._changed(self._place, lambda value: page.move_to((float(value[0]), float(value[1]), float(value[2]))))
            copy = gui.add_button("Copy", color="gray", hint="With the traps that hold it")
            self._clicked(copy, lambda: page.copy())
            delete = gui.add_button("Delete", color="gray", hint="Delete")
            self._clicked(delete, lambda: page.delete())
        with gui.add_folder("Path of a trap"):
            self._speed = gui.add_number("Speed [µm/s]", SPEED, min=0.001)
            begin = gui.add_button("Draw path", hint="Then click on its places")
            self._clicked(begin, lambda: page.begin_path())
            end = gui.add_button("End path", color="gray")
            self._clicked(end, lambda: page.end_path())
        with gui.add_folder("Scene"):
            self._undo = gui.add_button("Undo", color="gray", disabled=True, hint="Ctrl Z")
            self._clicked(self._undo, lambda: page.undo())
            self._file = gui.add_text("File", name)
            self._replace = gui.add_checkbox("Replace it", False, hint="If a file of that name is there already")
            save = gui.add_button("Save")
            self._clicked(save, lambda: page.save(self._file.value.strip(), self._replace.value))
        self._keys()

    @property
    def height(self) -> float:
        """At which new things are put [µm]."""
        return float(self._height.value)

    @property
    def size(self) -> float:
        """Of new things [µm]."""
        return float(self._size.value)

    @property
    def shape(self) -> str:
        """Of new robots."""
        return str(self._shape.value)

    @property
    def unit(self) -> float:
        """Of meshes that are imported [µm]."""
        return float(self._unit.value)

    @property
    def bounds(self) -> Any:
        """What the surface of such a mesh bounds."""
        return self._bounds.value

    def remarks(self, content: str) -> None:
        """Show what is to be said of the scene."""
        self._remarks.content = content

    @property
    def speed(self) -> float:
        """Of paths [µm/s]."""
        return float(self._speed.value)

    def state(self, text: str, undoable: int) -> None:
        """Say what the scene has, and whether something can be undone."""
        self._state.content = f'<div style="padding:2px 12px 6px;font-size:13px">{html.escape(text)}</div>'
        self._undo.disabled = undoable == 0
        self._undo.label = f"Undo ({undoable})" if undoable else "Undo"

    def say(self, text: str) -> None:
        """Say what is to be done next, over the picture."""
        self._note.content = overlay("note", html.escape(text))

    def listed(self, labels: Sequence[str]) -> None:
        """Things that can be taken."""
        options = (NOTHING, *labels)
        if tuple(self._list.options) != options:
            self._list.options = options

    def taken(self, item: Item | None) -> None:
        """This is taken now, None for nothing."""
        label = item.label if item is not None else NOTHING
        if self._list.value != label:
            self._list.value = label
        self._place.disabled = item is None
        if item is not None:
            x, y, z = (round(v, 4) + 0.0 for v in item.place)  # a field would show "-0"
            self._place.value = (x, y, z)
            traps = len(item.with_it) - 1
            also = f", with {traps} trap{'s' if traps > 1 else ''}" if traps else ""
            self.say(f"{item.label}: drag its handle{also}")
        else:
            self.say("")

    def _mesh(self) -> None:
        """What imports meshes; the unit and what is bounded count when the file comes."""
        gui, page = self._gui, self._page
        with gui.add_folder("Mesh", expand_by_default=False):
            self._unit = gui.add_number("Unit [µm]", 1.0, min=1e-6, hint="Of the file's numbers: 1000 for mm")
            self._bounds = gui.add_dropdown("Bounds", ("solid", "chamber", "sheet"), initial_value="solid")
            upload = gui.add_upload_button("Import STL, OBJ, PLY", color="gray", mime_type=".stl,.obj,.ply")

            async def sent(_: Any) -> None:
                file = upload.value
                page.post(lambda: page.mesh(file.name, file.content))

            upload.on_upload(sent)

    def _keys(self) -> None:
        for label, key, modifier, act in (
            ("Delete what is taken", "delete", None, self._page.delete),
            ("Undo", "Z", "cmd/ctrl", self._page.undo),
            ("Let go", "escape", None, self._page.let_go),
        ):
            command = self._gui.add_command(label, hotkey=key, modifier=modifier)  # type: ignore[arg-type]

            async def pressed(_: Any, act: Callable[[], None] = act) -> None:
                self._page.post(act)

            command.on_trigger(pressed)

    def _clicked(self, handle: Any, act: Callable[[], None]) -> None:
        async def clicked(_: Any) -> None:
            self._page.post(act)

        handle.on_click(clicked)

    def _changed(self, handle: Any, act: Callable[[Any], None]) -> None:
        async def changed(event: Any) -> None:
            value = handle.value
            if event.client_id is not None:  # else it was the server that set it
                self._page.post(lambda: act(value))

        handle.on_update(changed)
