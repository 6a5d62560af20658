"""`otwarp haptics config`: a configuration of the hands to start from."""

from __future__ import annotations

import click

from otwarp.cli.options import mode_option
from otwarp.cli.output import json_text


@click.command()
@mode_option
def config(mode: str) -> None:
    """Print the hands' configuration as JSON.

    What a file keeps of it changes the presets of otwarp teleop --config FILE; what it leaves out stays. Device side in
    m, s, N, scene side in µm, pN; docs/haptics.md says what each number does. Without traps a hand has the scene's.
    """
    from otwarp.haptics.core.config import two_hands
    from otwarp.haptics.core.fields import to_dict

    click.echo(json_text(to_dict(two_hands((), (), mode=mode))))
