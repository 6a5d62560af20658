"""`otwarp haptics check` through click, with short measurements."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner

from otwarp.cli.haptics.check import check
from otwarp.errors import InputError

SCENE = Path(__file__).parents[3] / "scenes" / "single_bead.usda"


@pytest.mark.thorough
def test_json_has_all_parts(device: str) -> None:
    options = ["--seconds", "0.05", "--no-width", "--json", "--scene", str(SCENE), "--scene-device", device]
    result = CliRunner().invoke(check, options, catch_exceptions=False)
    found = json.loads(result.stdout)
    assert found["latency"]["cycles"] == 50
    assert found["scene"]["bodies"] == 1 and found["scene"]["real_time_factor"] > 0.0
    assert {"devices", "grants", "jitter", "costs", "limits"} <= set(found)
    assert result.exit_code == 0


@pytest.mark.thorough
def test_tables_are_printed_and_parts_told() -> None:
    result = CliRunner().invoke(check, ["--seconds", "0.05", "--no-width"], catch_exceptions=False)
    assert result.exit_code == 0
    assert "What the system gives a servo" in result.stdout and "2b/T" in result.stdout
    assert "loop jitter" in result.stderr


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--seconds", "0"], "seconds"),
        (["--device", "spoon"], "unknown kind"),
        (["--scene", "absent.usda"], "absent.usda"),
    ],
)
def test_bad_input_is_one_line_and_told_first(options: list[str], words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []

    @contextmanager
    def _progress(as_json: bool) -> Iterator[Callable[[str], None]]:
        yield told.append

    monkeypatch.setattr("otwarp.cli.haptics.check._progress", _progress)
    with pytest.raises(InputError, match=words) as caught:
        CliRunner().invoke(check, ["--seconds", "0.05", "--no-width", *options], catch_exceptions=False)
    assert "\n" not in str(caught.value)
    assert not [line for line in told if line.startswith("looking for")]
