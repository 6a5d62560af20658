"""`otwarp bench me`: bills that add up, in words and as a picture."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from otwarp.bench.me.measure import BODIES, WORLDS
from otwarp.bench.me.table import digits, spell
from otwarp.cli.main import main


@pytest.mark.quick
def test_times_are_said_as_people_say_them() -> None:
    said = {4.5e-8: "45 ns", 1.24e-6: "1.2 µs", 0.04: "40 ms", 1.34: "1.3 s", 110.0: "110 s", 125.0: "2.1 min",
            9000.0: "2.5 h", 2e6: "23 d", 0.0: "0 ns"}  # fmt: skip
    assert {seconds: spell(seconds) for seconds in said} == said
    assert (digits(25543.0), digits(0.01234), digits(27.14)) == ("25,500", "0.0123", "27.1")


def test_bills_add_up(tmp_path: Path, device: str, capsys: pytest.CaptureFixture[str]) -> None:
    out, picture = tmp_path / "me.json", tmp_path / "me.png"
    options = ["--rounds", "1", "--seconds", "0.01", "--device", device, "-o", str(out), "--plot", str(picture)]
    assert main(["bench", "me", "single_bead", *options]) == 0
    assert "single_bead" in capsys.readouterr().out and picture.read_bytes().startswith(b"\x89PNG")
    found = json.loads(out.read_text())
    (bill,) = found["scenes"]
    assert bill["worlds"] == min(WORLDS[found["kind"]], BODIES[found["kind"]]) and bill["bodies"] == 1
    assert bill["factor"]["median"] == pytest.approx(bill["time_step"] / bill["step"]["median"])
    assert bill["all_factor"]["median"] > bill["factor"]["median"], "vectors, or a GPU, take more worlds at once"


def test_wrong_scenes_are_refused_before_anything_runs(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "me", "single_bead", "none.usda"]) == 2
    assert "none.usda: there is no such file" in capsys.readouterr().err
