"""What `otwarp view` and `otwarp edit` do: open what is to be shown, refuse what cannot be, serve the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from otwarp import shipped
from otwarp.errors import InputError
from otwarp.files import check_place
from otwarp.scene.write.edit import StageEditor
from otwarp.studies.rerun import stored_study
from otwarp.studies.store import open_store
from otwarp.teleop.page.front import DRAGS
from otwarp.teleop.recording.frames import is_session
from otwarp.view.controls import KEYS
from otwarp.view.edit_page import KEYS as EDIT_KEYS
from otwarp.view.edit_page import EditPage
from otwarp.view.page import ViewPage
from otwarp.view.recorded import RecordedRun
from otwarp.view.serve import ServeOptions, served
from otwarp.view.session import SessionSource
from otwarp.view.study_tab import StudyTab
from otwarp.view.theme import THEMES

SEEK = (*DRAGS, ("click in a plot", "go to that time"))
"""What the mouse does on a page of recordings."""


def show_runs(
    paths: Sequence[Path],
    options: ServeOptions,
    *,
    world: int = 0,
    scene: Path | None = None,
    theme: str = "dark",
    say: Callable[[str], None] = print,
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Show one run, or compare two, until stopped.

    Args:
        paths: Folders of runs, or their `run.usda` or `run.nc`; or recordings of sessions.
        options: Where the page is served.
        world: Which world of them.
        scene: Where the scene of a session is now; None for where it was.
        theme: `dark` or `light`.
        say: Gets the line with the page's address.
        stopped: Asked thirty times a second.

    Raises:
        InputError: None or more than two, or one that is no whole run of this version.
    """
    if not 1 <= len(paths) <= 2:
        raise InputError(f"{len(paths)} runs; allowed: one, or two to compare")
    runs = [_opened(path, world, scene) for path in paths]
    if len({run.title for run in runs}) < len(runs):
        for n, run in enumerate(runs, start=1):
            run.title = f"{run.title} ({n})"
    title = f"otwarp · {' and '.join(run.title for run in runs)}"
    with served(options, title, KEYS, say, SEEK) as server:
        page = ViewPage(server, THEMES[theme])
        page.show(runs)
        page.run(stopped)


def _opened(path: Path, world: int, scene: Path | None) -> RecordedRun | SessionSource:
    """A run, or a session, whose file is known by its name."""
    if not is_session(path):
        return RecordedRun(path, world)
    if world:
        raise InputError(f"--world is {world}, but {path} is a session; allowed: 0, the only one")
    return SessionSource(path, scene)


def show_study(
    folder: Path,
    options: ServeOptions,
    *,
    theme: str = "dark",
    say: Callable[[str], None] = print,
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Show the map of a study, and the trials of points that are clicked on, until stopped.

    Args:
        folder: Of the study.
        options: Where the page is served.
        theme: `dark` or `light`.
        say: Gets the line with the page's address.
        stopped: Asked thirty times a second.

    Raises:
        InputError: It holds no study of this version, none of it is done, or its trials cannot be had again.
    """
    store = open_store(folder)
    study = stored_study(store)
    with served(options, f"otwarp · {folder.resolve().name}", KEYS, say, SEEK) as server:
        page = ViewPage(server, THEMES[theme])
        StudyTab(page, server, store, study)
        page.run(stopped)


def edit_scene(
    scene: Path,
    options: ServeOptions,
    *,
    out: Path | None = None,
    theme: str = "dark",
    say: Callable[[str], None] = print,
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Draw a scene on a page, until stopped.

    Args:
        scene: A USD file.
        options: Where the page is served.
        out: File that is proposed to be saved; None for one beside the scene, of a shipped one in this folder.
        theme: `dark` or `light`.
        say: Gets the line with the page's address.
        stopped: Asked ten times a second.

    Raises:
        InputError: The scene cannot be loaded, or not be edited, or nothing can be written where it is to be saved.
    """
    folder = Path() if scene.parent == shipped.folder("scenes") else scene.parent
    proposed = out if out is not None else folder / f"{scene.stem}_edited.usda"
    check_place(proposed, "what is to be saved")
    editor = StageEditor(scene)
    try:
        clicks = (("click", "take a thing"), ("arrows of its handle", "move it"), *DRAGS)
        with served(options, f"otwarp · edit {scene.stem}", EDIT_KEYS, say, clicks) as server:
            EditPage(server, editor, proposed, THEMES[theme]).run(stopped)
    finally:
        editor.close()
