"""The shipped studies: they load, and the largest speed without noise is what the equation of drag says."""

from __future__ import annotations

import numpy as np
import pytest

import otwarp as ot
from benchmarks.shipped_studies import BEGIN, DRAWN, END, PAGE, ROOT, drag_limits
from otwarp.studies import load_study

LIMIT = 118.66
"""Speed per power at which drag exceeds the trap's force, on the page [µm/s/mW]."""


BLOCKS = {"capture": 16, "transport": 5, "delivery": 60, "robot_hold": 7, "escape": 8}
"""Long trials of many bodies make small blocks: each is progress, is kept by a kill, and can be shared out."""


@pytest.mark.parametrize("name", DRAWN)
def test_they_load(name):
    study = load_study(ROOT / "studies" / f"{name}.toml")
    assert len(study.blocks()) == BLOCKS[name]
    assert study.design.points > 1 and (ROOT / "docs" / "images" / f"study_{name}.png").is_file()
    results = [o.name for o in study.observables] if name != "escape" else ["escape_rate"]
    assert not DRAWN[name] or DRAWN[name] in results


def test_the_page_holds_the_limit_and_speeds_below_it():
    text = PAGE.read_text().split(BEGIN)[1].split(END)[0]
    assert f"gives {LIMIT:.1f} µm/s per mW" in text
    shares = [float(line.rsplit("|", 2)[1]) for line in text.splitlines() if line.startswith("| ") and "mW" not in line]
    assert len(shares) == 5 and shares == sorted(shares) and shares[-1] < 1.0


@pytest.mark.thorough
def test_without_noise_the_largest_speed_is_the_drag_limit(tmp_path):
    """At two powers, between neighbours 1 % apart on a grid around it: the table's error and the step's are smaller."""
    scene = ROOT / "scenes" / "transport.usda"
    assert drag_limits(ot.Scene.load(scene))[1] == pytest.approx(LIMIT, rel=2e-3)
    for power in (1.0, 4.0):
        study = ot.Study(
            scene,
            axes={
                "/World.ot:scene:brownian": ot.values([False]),
                "trap_power": ot.values([power], unit="mW"),
                "speed:/World/Traps/trap": ot.values(LIMIT * power * np.linspace(0.9, 1.1, 21), unit="µm/s"),
            },
            observables=[ot.trapped(until=0.5)],
            # one trial without noise is all of them: its interval is as wide as any, its estimate exact
            stop=ot.largest(0.5, along="speed:/World/Traps/trap", trials=1),
        )
        found = study.run(tmp_path / f"{power:g}", devices=["cpu"])
        assert float(found["largest"].squeeze()) == pytest.approx(LIMIT * power, rel=0.015)
