"""What `otwarp validate` says of a scene that is drawn: found in a thread after each edit, shown while one goes on."""

from __future__ import annotations

import html
import queue
import shutil
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from otwarp.errors import InputError
from otwarp.record import check_run
from otwarp.scene import Scene
from otwarp.scene.finding import Finding
from otwarp.scene.read.validate import finding, validate

MOST_SHOWN = 12
COLOURS = {"error": "#ff8a80", "warning": "#ffc959"}
LIGHT = {"error": "#b3261e", "warning": "#8a5200"}


class Remarks:
    """A thread that judges the newest scene that it was given.

    Args:
        show: Gets the findings, in this thread.
    """

    def __init__(self, show: Callable[[Sequence[Finding]], None]):
        self._show = show
        self._waiting: queue.SimpleQueue[tuple[Scene, Path] | None] = queue.SimpleQueue()
        self._folder = tempfile.TemporaryDirectory(prefix="otwarp-remarks-")
        self._count = 0
        self._thread = threading.Thread(target=self._run, name="remarks", daemon=True)
        self._thread.start()

    def ask(self, scene: Scene) -> None:
        """Judge a scene; one that still waits is passed over.

        Args:
            scene: With its file, which is copied.
        """
        self._count += 1
        copy = Path(self._folder.name) / f"{self._count}.usda"  # USD remembers files by their names
        shutil.copyfile(str(scene.file), copy)
        self._waiting.put((scene, copy))

    def close(self) -> None:
        """End the thread, once it is done with what it does."""
        self._waiting.put(None)
        self._thread.join()
        self._folder.cleanup()

    def _run(self) -> None:
        while (asked := self._waiting.get()) is not None:
            scene, file = asked
            if self._waiting.empty():
                try:
                    found = judged(scene, file)
                except Exception as error:  # a defect of ours ends neither this thread nor the remarks to come
                    found = [finding(file, f"could not be judged, a defect of otwarp: {type(error).__name__}: {error}")]
                if self._waiting.empty():
                    self._show(found)
            file.unlink()


def judged(scene: Scene, file: Path) -> list[Finding]:
    """What `otwarp validate` says of a scene.

    Args:
        scene: It.
        file: It, as a file.
    """
    found = list(validate(file).findings)
    try:
        found += [finding(file, text, "warning") for text in check_run(scene)]
    except InputError as error:
        found.append(finding(file, str(error)))
    return found


def as_html(found: Sequence[Finding], light: bool) -> str:
    """Findings for the panel, errors first."""
    if not found:
        return _box("nothing: it would run as it is")
    rows = sorted(found, key=lambda f: f.severity)
    lines = [
        f'<li style="margin-bottom:4px"><b style="color:{(LIGHT if light else COLOURS)[f.severity]}">{f.severity}</b> '
        f"{html.escape('' if f.prim == '/' else f.prim + ': ')}{html.escape(f.message)}</li>"
        for f in rows[:MOST_SHOWN]
    ]
    more = f"<li>and {len(rows) - MOST_SHOWN} more</li>" if len(rows) > MOST_SHOWN else ""
    return _box(f'<ul style="margin:0;padding-left:16px;overflow-wrap:anywhere">{"".join(lines)}{more}</ul>')


def _box(content: str) -> str:
    return f'<div data-remarks style="padding:2px 12px 6px;font-size:13px">{content}</div>'
