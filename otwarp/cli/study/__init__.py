"""`otwarp study`: batched studies of a scene; one module for every command.

`plan`, `run`, `status`, `show`, `export`: a command each, which asks `otwarp.studies` (open `run` first). `table`
is what `show` prints.
"""

from __future__ import annotations

import click

from otwarp.cli.lazy import LazyGroup

COMMANDS = {
    "plan": "Say what a study will compute, and how long that takes; nothing is stored.",
    "run": "Compute a study, or go on with it.",
    "status": "Say how far a study is.",
    "show": "Print or draw what a study has found.",
    "export": "Write what a study has found as one netCDF file.",
}
"""Commands and their one-line help; each lives in the module of its name and is imported when called."""


@click.group(cls=LazyGroup, package=__name__, rows=COMMANDS)
def study() -> None:
    """Batched Monte-Carlo studies: trials of a scene at many points, with intervals."""
