"""`otwarp haptics config` as typed."""

from __future__ import annotations

import json

from otwarp.cli.main import main
from otwarp.haptics.core.config import HapticsConfig, two_hands
from otwarp.haptics.core.fields import from_dict


def test_what_is_printed_is_the_preset(capfd):
    for mode in ("stable", "paper"):
        assert main(["haptics", "config", "--mode", mode]) == 0
        assert from_dict(HapticsConfig, json.loads(capfd.readouterr().out)) == two_hands((), (), mode=mode)
    assert main(["haptics", "config", "--mode", "loud"]) == 2
