"""The map of a study beside the picture: a click on a point, and one of its trials is run again and shown."""

from __future__ import annotations

import html
import threading
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from otwarp.errors import InputError
from otwarp.studies.rerun import Rerun, rerun
from otwarp.studies.store import Store
from otwarp.studies.study import Study
from otwarp.view.source import Source
from otwarp.view.study_map import FIELD, StudyMap
from otwarp.view.trial import TrialSource

if TYPE_CHECKING:
    import viser


class Showing(Protocol):
    """What the tab needs of a page."""

    @property
    def side(self) -> Any:
        """The panel for its tab."""
        ...

    def post(self, work: Callable[[], None]) -> None:
        """Have something done by the page's thread."""
        ...

    def show(self, sources: list[Source]) -> None:
        """Show recordings."""
        ...

    def tell(self, line: str, colour: Any = "orange") -> None:
        """Show a line in all windows."""
        ...


class StudyTab:
    """The tab; trials run in a thread of their own, one after the other, and only the latest that was asked for.

    Args:
        page: Where trials are shown.
        server: Of viser.
        store: The study's folder.
        study: As it was asked.
    """

    def __init__(self, page: Showing, server: viser.ViserServer, store: Store, study: Study):
        self._page, self._store, self._study = page, store, study
        self._map = StudyMap(store, study)
        self._point = self._map.first()
        self._wanted: tuple[int, int] | None = None
        self._wake = threading.Condition()
        gui = server.gui
        panel = gui.add_panel()
        panel.dock_above(page.side)
        with panel.add_tab("Map"):
            names = self._map.observables
            self._observable: Any = gui.add_dropdown(
                "Result", names or ("trials",), initial_value=(names or ("trials",))[0]
            )
            self._slices: dict[str, Any] = {
                dim: gui.add_dropdown(dim, self._map.axes[dim], initial_value=self._map.axes[dim][0])
                for dim in self._map.dims[:-2]
            }
            self._grid = gui.add_html("")
            self._said = gui.add_html("")
            self._field = gui.add_text(FIELD, str(self._point), hint="Its number; a click on the map puts it here")
            self._trial = gui.add_number("Trial", 0, min=0, step=1, hint="Of the point, from 0")
        for handle in (self._observable, *self._slices.values()):
            self._changed(handle, lambda _: self._draw())
        self._changed(self._field, self._typed)
        self._changed(self._trial, lambda _: self._ask())
        self._draw()
        threading.Thread(target=self._work, daemon=True, name="view-trials").start()
        self._ask()

    def _typed(self, text: str) -> None:
        """A point was clicked on, or its number typed."""
        try:
            point = int(text)
        except ValueError:
            return
        if not 0 <= point < self._study.design.points:
            self._page.tell(f"point {point} is none of this study's; allowed: 0 … {self._study.design.points - 1}")
            return
        self._point = point
        self._draw()
        self._ask()

    def _draw(self) -> None:
        fixed = {dim: list(handle.options).index(handle.value) for dim, handle in self._slices.items()}
        if self._map.observables:
            self._grid.content = self._map.grid(self._observable.value, fixed, self._point)

    def _ask(self) -> None:
        """Have the trial run that is asked for now."""
        self._say("running …")
        with self._wake:
            self._wanted = (self._point, int(self._trial.value))
            self._wake.notify()

    def _say(self, text: str) -> None:
        where = ", ".join(f"{name} = {value}" for name, value in self._map.said(self._point))
        count = self._map.trials(self._point)
        self._said.content = (
            f'<div style="padding:2px 12px 8px;font-size:12.5px;line-height:1.45">{html.escape(where)}; {count} trials'
            f"<br>{html.escape(text)}</div>"
        )

    def _work(self) -> None:
        """Thread: run what is asked for, and only the latest."""
        while True:
            with self._wake:
                while self._wanted is None:
                    self._wake.wait()
                (point, trial), self._wanted = self._wanted, None
            try:
                found = rerun(self._store, self._study, point, trial)
            except InputError as error:
                line = str(error)
                self._page.post(lambda line=line: self._say(line))
                continue
            except Exception:
                traceback.print_exc()
                self._page.post(lambda: self._say("it could not be run again; the terminal says why"))
                continue
            self._page.post(lambda found=found, point=point, trial=trial: self._show(found, point, trial))

    def _show(self, found: Rerun, point: int, trial: int) -> None:
        if point != self._point:
            return
        title = f"trial {trial} of point {point}"
        self._page.show(
            [TrialSource(found, title, (("point", str(point)), ("trial", str(trial)), *self._map.said(point)))]
        )
        same = "the bits of the study's own trial" if found.same else "NOT the trial that the study recorded"
        self._say(f"trial {trial}: {found.end}; {same}")

    def _changed(self, handle: Any, act: Callable[[Any], None]) -> None:
        async def changed(event: Any) -> None:
            value = handle.value
            if event.client_id is not None:  # else it was the server that set it
                self._page.post(lambda: act(value))

        handle.on_update(changed)
