"""The table of what float32 costs: tiny sizes, and the figures that must come out whatever the noise."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import precision
from benchmarks.report import Section
from otwarp.kernels.core.precision import PRECISIONS
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from tests.benchmarks.test_benchmarks import cells, strictly

TIMED = ("bead, harmonic trap", "robot of 5 spheres, 3 traps")
"""Whose kernels the other tables need as well."""


@pytest.fixture(scope="module")
def section() -> Section:
    small = {"places": (0.0, 1e6), "stiffnesses": (20.0,), "moduli": (1e3,), "longest": 1000, "timed": TIMED}
    return precision.measure("cpu", rounds=2, seconds=1e-3, worlds=20, **small)


def test_far_from_the_origin_float32_stands_still(section: Section, tmp_path: Path):
    near, far = strictly(section, tmp_path)["far"]
    for what in ("variance", "diffusion", "noisy drift", "still drift"):
        # 1e-5: roundings of 6e-8 at the origin, of some hundred steps
        assert abs(near[what]) < 1e-5
    # coordinates 62 nm apart, steps of 7 and 10 nm
    assert far["diffusion"] < -0.9
    assert far["noisy drift"] < -0.9
    assert far["still drift"] == -1.0
    assert near["path"] < 1e-5 < far["path"]


def test_contact_and_long_runs_part_by_rounding(section: Section, tmp_path: Path):
    data = strictly(section, tmp_path)
    (touching,) = data["contact"]
    assert touching["load"] == pytest.approx(3.0, rel=0.2)
    assert 0.0 < abs(touching["load error"]) < 1e-3
    (run,) = data["long"]
    assert 0.0 < run["free"] < 1e-5 * run["walked"]
    assert run["norm float64"] < 1e-15 < run["norm float32"] < 1e-6
    assert all(row["ratio"]["median"] > 0.0 for row in data["times"].values())


def test_tables_are_complete(section: Section):
    assert [len(cells(table)) for table in section.tables] == [2, 2, 1, 1, len(TIMED)]


@pytest.mark.parametrize("name", precision.TIMES)
def test_what_is_timed_goes_in_both_precisions(name: str):
    for wanted in PRECISIONS:
        options = StepOptions(precision=wanted, allow_large_step=True)
        assert Model.build(precision.TIMES[name](), device="cpu", options=options).features.precision == wanted
