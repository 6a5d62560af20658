"""The table of what cheaper noise costs: the page holds what the script computes."""

from __future__ import annotations

import pytest

from benchmarks import weak_noise
from benchmarks.validation import put_on_page
from otwarp.errors import InputError
from otwarp.kernels.core.noise import NOISES
from otwarp.kernels.integrate.integrators import INTEGRATORS


def page_rows() -> list[list[str]]:
    text = weak_noise.PAGE.read_text().split(weak_noise.BEGIN)[1].split(weak_noise.END)[0]
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


@pytest.mark.parametrize(("integrator", "noise"), [("heun", "threePoint"), ("leimkuhlerMatthews", "uniform")])
def test_rows_of_the_page_are_those_of_the_script(integrator, noise):
    head, *rows = page_rows()
    assert tuple(head) == weak_noise.HEAD
    assert len(rows) == len(INTEGRATORS) * len(NOISES) * len(weak_noise.DIVISIONS)
    found = weak_noise.row(integrator, noise, weak_noise.DIVISIONS[0])
    (printed,) = [row for row in rows if row[:3] == list(found[:3])]
    for here, there in zip(found[3:], printed[3:], strict=True):
        # as printed, to the last digit
        assert here == there or abs(float(here) - float(there)) < 0.0015


def test_a_page_without_markers_is_refused():
    with pytest.raises(InputError, match="must hold the markers"):
        put_on_page("nothing", "text", weak_noise.BEGIN, weak_noise.END)
