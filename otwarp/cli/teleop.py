"""`otwarp teleop`: a scene, live."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli.live_options import live_options, open_session, read_session, run_session
from otwarp.cli.options import scene_argument


@click.command()
@scene_argument
@live_options(page=True, browser=True)
def teleop(scene: Path, **options: Any) -> int:
    """Run SCENE live: move traps with the page's gizmos or with devices, feel and see what happens.

    Without --left and --right every trap has a gizmo on the page, and nothing is felt. A hand moves the traps whose
    ot:trap:hand names it. Ctrl-C ends the session.
    """
    return run_session(open_session(*read_session(scene, options), options), options)
