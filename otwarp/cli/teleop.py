"""`otwarp teleop`: a scene, live."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli.options import scene_argument
from otwarp.cli.options.camera import camera_options, open_perception, split_options
from otwarp.cli.options.live import live_options, open_session, read_session, run_session, sayer


@click.command()
@scene_argument
@live_options(page=True, browser=True)
@camera_options()
def teleop(scene: Path, **options: Any) -> int:
    """Run SCENE live: move traps with the page's gizmos or with devices, feel and see what happens.

    Without --left and --right every trap has a gizmo on the page, and nothing is felt. A hand moves the traps whose
    ot:trap:hand names it. Ctrl-C ends the session. With --camera the scene is the twin of what a camera sees: images
    say where its bodies are, and hands feel them there.
    """
    asked, options = split_options(options)
    loaded, session = read_session(scene, options)
    twin, perception = open_perception(loaded, session, asked, sayer(options))
    try:
        opened = open_session(twin, session, options, perception)
    except BaseException:
        if perception is not None:
            perception.close()
        raise
    return run_session(opened, options)
