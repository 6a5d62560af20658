"""What a study will take, and steps that some of its points cannot."""

from __future__ import annotations

import pytest

from otwarp.errors import InputError
from otwarp.studies.file import load_study
from tests.studies.scenes import bead_in_a_well

pytest.importorskip("zarr")

FILE = """
scene = "well.usda"
time_step = "1 ms"
[[axis]]
name = "trap_power"
values = [0.3, 1, 900, 9000]
unit = "mW"
"""
ENDINGS = {
    "trials": '[[observable]]\nkind = "trapped"\nuntil = "0.1 s"\n[stop]\ntrials = 8\n',
    "escapes": '[escape]\norder = "distance"\n',
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well")).parent


@pytest.mark.parametrize("kind", ENDINGS)
def test_a_power_beyond_the_stable_step(folder, kind):
    """Found when the file is read: which file, which axis, the first power that the step is too long for."""
    (folder / "s.toml").write_text(FILE + ENDINGS[kind])
    with pytest.raises(
        InputError, match=r"s\.toml: at trap_power = 900 mW: time step 0\.001 s is unstable: .* allowed"
    ):
        load_study(folder / "s.toml")
