"""What a study will take, and steps that some of its points cannot."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.studies import study as studies
from otwarp.studies.axes import grid, values
from otwarp.studies.engines.run import run_study
from otwarp.studies.file import load_study
from otwarp.studies.observables import trapped
from otwarp.studies.results import table
from otwarp.studies.stopping.rules import trials
from otwarp.studies.study import Study
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


AXIS = '[[axis]]\nname = "trap_power"\nvalues = [0.3, 0.5]\nunit = "mW"\n'
ENDLESS = {
    "until": ("", ENDINGS["trials"].replace("0.1 s", "1e30 s")),
    "beyond float64": ("", ENDINGS["trials"].replace("0.1 s", "1e308 s")),
    "own steps": ('time_step = "per point"', ENDINGS["trials"].replace("0.1 s", "1e30 s")),
    "short steps": ('time_step = "1e-12 s"', ENDINGS["trials"]),
    "escapes": ('horizon = "1e30 s"', ENDINGS["escapes"]),
}


@pytest.mark.quick
@pytest.mark.parametrize("kind", ENDLESS)
def test_a_trial_of_more_steps_than_a_device_counts(folder, tmp_path, kind, capsys):
    """Refused in a line by plan and run: where 10³⁴ steps were planned, a device would have had another clock."""
    (top, rest), file = ENDLESS[kind], folder / "s.toml"
    file.write_text(f'scene = "well.usda"\n{top}\n{AXIS}{rest}')
    name = "until" if "until" in rest else "horizon"
    for command in (["plan"], ["run", "-o", str(tmp_path / "out")]):
        assert main(["study", *command, str(file), "--device", "cpu"]) == 2
        said = capsys.readouterr().err
        assert re.fullmatch(rf"otwarp: .*s\.toml: {name} is \S+ s at a time step of \S+ s, \S+ steps a trial; "
                            r"allowed: up to 2,147,483,647 steps, \S+ s\n", said)  # fmt: skip
    assert not list(tmp_path.iterdir())


def test_a_folder_keeps_the_blocks_that_it_was_made_with(folder, tmp_path, monkeypatch):
    """Begun by a version that cut the study otherwise, it goes on in those blocks, to the bits of any others."""
    axes = {"trap_power": values([0.3, 0.4, 0.5], unit="mW"), "start.x:/World/bead": grid(0.0, 0.3, 4, unit="µm")}
    study = Study(folder / "well.usda", axes=axes, observables=[trapped(until=0.004)], stop=trials(16), seed=3)
    whole = run_study(study, tmp_path / "whole", devices=["cpu"])
    assert whole.asked()["blocks"] == len(study.blocks()) == 1
    monkeypatch.setattr(studies, "BLOCK_WORK", 16 * study.runner.steps * 4)
    small = run_study(study, tmp_path / "small", devices=["cpu"], shard=(2, 3))
    assert small.finished() == [1] and small.cut() == (1, 4)
    monkeypatch.undo()
    said: list[tuple[int, int]] = []
    run_study(study, tmp_path / "small", devices=["cpu"], progress=lambda done, of: said.append((done, of)))
    assert said == [(1, 3), (2, 3), (3, 3)] and small.finished() == [0, 1, 2]
    assert table(small).identical(table(whole))
    assert run_study(study, tmp_path / "whole", devices=["cpu"]).finished() == [0]


@pytest.mark.parametrize(("points", "each", "blocks"), [(16, 1024, 16), (64, 1024, 64), (128, 1024, 256)])
def test_wide_maps_have_larger_blocks_before_they_have_more(folder, points, each, blocks):
    """Of 16 points of 1,024 trials at least, of 64 at most, and in between such that there are 64 blocks."""
    axes = {
        "trap_power": grid(0.3, 0.5, points, unit="mW"),
        "start.x:/World/bead": grid(0.0, 0.3, points, unit="µm"),
    }
    study = Study(folder / "well.usda", axes=axes, observables=[trapped(until=0.004)], stop=trials(each), seed=3)
    assert len(study.blocks()) == blocks


@pytest.mark.parametrize("room", [1, 3])
def test_blocks_of_long_trials_stay_small(folder, monkeypatch, room):
    """However many there are, none holds more steps than four times what a small one may."""
    axes = {"trap_power": grid(0.3, 0.5, 1000, unit="mW")}
    study = Study(folder / "well.usda", axes=axes, observables=[trapped(until=0.004)], stop=trials(16), seed=3)
    monkeypatch.setattr(studies, "BLOCK_WORK", 16 * study.runner.steps * room // 4)
    assert study.points_of_a_block == room


def test_plan_says_what_needs_models(folder, capsys):
    """Only axes whose values need a model of their own are named, and there is memory in every plan."""
    text = FILE.replace("900, 9000", "2").replace('time_step = "1 ms"\n', "")
    radius = '[[axis]]\nname = "/World/bead/sphere.radius"\nvalues = [0.4, 0.5, 0.6]\nunit = "µm"\n'
    (folder / "p.toml").write_text(text + radius + ENDINGS["trials"])
    assert main(["study", "plan", str(folder / "p.toml"), "--device", "cpu"]) == 0
    said = capsys.readouterr().out
    assert "9 (3 trap_power × 3 sphere_radius), in 3 models: one for each value of /World/bead/sphere.radius\n" in said
    few = ENDINGS["escapes"] + "runs = 2\nbranches = 600\n"
    (folder / "p.toml").write_text(text.replace("0.3, 1, 2", "0.3") + few)
    assert main(["study", "plan", str(folder / "p.toml"), "--device", "cpu"]) == 0
    said = capsys.readouterr().out
    assert "points    1 (1 trap_power), in 1 model\n" in said
    assert re.search(r"^memory    [\d.,]+ [KM]iB for 1,200 paths at once, .* free$", said, re.MULTILINE)


def test_a_trap_weaker_than_the_scenes_is_planned(folder, capsys):
    """It takes longer steps than the scene with its own power could."""
    shipped = Path(__file__).parents[2] / "scenes" / "table_trap.usda"
    text = (
        FILE.replace('time_step = "1 ms"\n', "")
        .replace("0.3, 1, 900, 9000", "0.036")
        .replace("well.usda", str(shipped))
    )
    (folder / "p.toml").write_text(text + ENDINGS["escapes"] + "runs = 2\nbranches = 20\n")
    assert main(["study", "plan", str(folder / "p.toml"), "--device", "cpu"]) == 0
    assert "points    1 (1 trap_power), in 1 model\n" in capsys.readouterr().out
