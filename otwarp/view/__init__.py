"""Recordings in the browser: a run, or two beside each other, or trials of a study, played back; scenes, drawn.

In come recorded runs and studies on disk, out goes a page of viser's, drawn with the parts of the live page
(`otwarp.teleop.page`) and under its access rules. It only reads; what is drawn anew is written where it is told to.
Open `show` first, then `page`.

| file | what it holds |
|---|---|
| `show` | `show_runs`, `show_study`, `edit_scene`: what `otwarp view` and `otwarp edit` do |
| `serve` | a guarded server, its address, its end |
| `source` | `Source`: moments of one world, whatever they come from |
| `recorded`, `session`, `trial` | as sources: a run, mapped from disk; a session; a trial of a study, run again |
| `study_map`, `study_tab` | a study's results as a grid that is clicked on; trials run again, in a thread |
| `page`, `controls` | the page's one thread; its buttons and keys |
| `playback` | the clock: which moment is shown |
| `curves`, `plots` | curves over a whole run, thinned so that peaks stay; their plots |
| `sight` | presets of the camera, scale bar, legend |
| `measure`, `tape` | where a click meets the scene; the measuring tool |
| `scale_bars` | a scale bar in each window |
| `theme` | colours, dark and light |
| `edit_page`, `edit_controls` | a scene that is drawn: the page's one thread; its buttons and keys |
| `items` | what of a scene can be taken, and which of it a ray meets |
| `new_items`, `new_pieces` | what is added to it: single things; robots with their traps, and meshes |
| `remarks` | what `otwarp validate` says of it, found in a thread |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.view.recorded import RecordedRun as RecordedRun
    from otwarp.view.serve import ServeOptions as ServeOptions
    from otwarp.view.show import edit_scene as edit_scene
    from otwarp.view.show import show_runs as show_runs
    from otwarp.view.show import show_study as show_study

__getattr__, __dir__ = lazy_names(
    __name__,
    {"recorded": ("RecordedRun",), "serve": ("ServeOptions",), "show": ("edit_scene", "show_runs", "show_study")},
)
