"""`run.nc` in Octave: every number that netCDF4 reads here, bit for bit, and the recipe that MATLAB runs as well.

Octave and its package netcdf come from Debian (`make debian`); CI sets OTWARP_REQUIRE_OCTAVE=1, others skip without.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from otwarp.record.monitor import Monitor
from otwarp.record.netcdf import NetcdfRecording
from tests.record.small_run import HELD, RATE, frame, load

RECIPE = Path(__file__).parents[2] / "docs" / "recipes" / "read_run.m"
NAMES = ("time", "step", "position", "orientation", "trap_position", "trap_force", "trap_power", "contact_force")
DUMP = """
pkg load netcdf
file = '{file}';
for name = {{{names}}}
  values = double(ncread(file, name{{1}}));
  printf('%s|%s|%s|', name{{1}}, mat2str(size(values)), ncreadatt(file, name{{1}}, 'units'));
  printf('%.17g ', values(:));
  printf('\\n');
end
"""


def octave(script: str) -> str:
    """What Octave prints."""
    program = shutil.which("octave-cli")
    asked = [program, "--norc", "--eval", "pkg load netcdf"]
    if program is None or subprocess.run(asked, capture_output=True, timeout=120, check=False).returncode != 0:
        if os.environ.get("OTWARP_REQUIRE_OCTAVE") == "1":
            pytest.fail("OTWARP_REQUIRE_OCTAVE=1, and Octave or its netcdf is absent: `make debian`")
        pytest.skip("Octave or its package netcdf is absent: `make debian`")
    done = subprocess.run(
        [program, "--norc", "--eval", script], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("octave")
    scene = load(folder)
    recording = NetcdfRecording(
        folder / "run.nc", scene, Monitor(scene, HELD, 2), worlds=2, total_worlds=2, seed=7, time_step=1e-4,
        frames_per_second=RATE,
    )  # fmt: skip
    for index in range(5):
        recording.write(frame(scene, index, worlds=2))
    recording.close()
    return folder / "run.nc"


def test_every_number_and_unit_is_that_of_the_file(run: Path):
    said = octave(DUMP.format(file=run, names=", ".join(f"'{name}'" for name in NAMES)))
    rows = {row.split("|")[0]: row.split("|")[1:] for row in said.splitlines()}
    with netCDF4.Dataset(run) as data:
        for name in NAMES:
            shape, unit, numbers = rows[name]
            wanted = data[name][:].data
            # Octave and MATLAB count dimensions from the fastest, and give a vector a second one
            assert [int(n) for n in re.findall(r"\d+", shape)] == [*reversed(wanted.shape), 1][: max(wanted.ndim, 2)]
            assert unit == data[name].units
            np.testing.assert_array_equal(np.array(numbers.split(), dtype=float), wanted.ravel().astype(float))


def test_the_recipe_runs_as_the_page_says(run: Path, monkeypatch: pytest.MonkeyPatch):
    page = (RECIPE.parents[1] / "elsewhere.md").read_text(encoding="utf-8")
    (line,) = re.findall(r'^octave --eval "(.+)"$', page, re.MULTILINE)
    monkeypatch.chdir(run.parent)
    said = octave(line.replace("out/cell_delivery/run.nc", run.name).replace("docs/recipes/read_run.m", str(RECIPE)))
    with netCDF4.Dataset(run) as data:
        along = np.std(data["position"][:, 0, 0, 0].data.astype(float), ddof=1)
        pull = data["trap_force"][:, 0, 0, 2].data.mean(dtype=float)
    assert said.splitlines()[0] == f"/World/Group/left: 5 frames to {4 / RATE:.6g} s, position in um"
    numbers = [float(x) for x in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", said.splitlines()[1])]
    np.testing.assert_allclose(numbers, [along, pull], rtol=1e-3, atol=1e-12)
