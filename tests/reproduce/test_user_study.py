"""The user study with SIMULATED operators, small, end to end."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.reproduce.item import Request
from otwarp.reproduce.items import user_study


@pytest.mark.thorough
def test_a_small_study_is_beside_the_papers(tmp_path: Path, device: str):
    request = Request(quick=True, device=device, scenes=Path("scenes"), seed=0, folder=tmp_path, work=tmp_path / "work",
                      say=lambda line: None)  # fmt: skip
    found = user_study.run(request)
    rows = {row.what: row for row in found.comparisons}
    assert rows["success, with haptics"].paper.number == 0.8 and rows["success, without"].paper.number == 0.3
    assert rows["p of no difference"].paper.number == pytest.approx(0.0698, abs=1e-4)
    assert rows["Hedges' g of success"].paper.number == pytest.approx(1.18, abs=0.03)
    assert all("imulated" in row.remark for row in found.comparisons)
    assert found.numbers["simulated"] is True
    assert found.numbers["operators"] == 96 and (tmp_path / "user_study.png").is_file()
    assert "SIMULATED" in found.figures[0].caption and "SIMULATED" in found.definition
