"""What `otwarp study` and `otwarp analyse` say of studies: answers first, what is not there, the time left."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import sys
from collections.abc import Callable

import numpy as np
import pytest
import xarray

import otwarp as ot
from otwarp.cli import progress
from otwarp.cli.main import main
from otwarp.cli.study.table import columns
from otwarp.studies.axes import grid, values
from otwarp.studies.engines.run import run_study
from otwarp.studies.observables import trapped
from otwarp.studies.rare.study import EscapeStudy
from otwarp.studies.results import table
from otwarp.studies.stopping.rules import trials
from otwarp.studies.stopping.search import largest
from otwarp.studies.store import Store, open_store
from otwarp.studies.study import Study
from tests.full_disk import largest_file
from tests.studies.scenes import bead_in_a_well, study_of_a_well

pytest.importorskip("zarr")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


def small(scene, **how) -> Study:
    asked = {"observables": [trapped(until=0.004)], "stop": trials(8), "seed": 3}
    return Study(scene, **(asked | how))


def test_show_says_what_was_searched_first(scene, tmp_path, capsys):
    """A row for each power with the answer and its interval, not the points that were looked at on the way."""
    axes = {
        "trap_power": values([0.1, 0.2], unit="mW"),
        "start.x:/World/bead": grid(0.0, 0.39, 40, unit="µm"),
    }
    study = small(scene, axes=axes, stop=largest(0.8, along="start.x:/World/bead", trials=64))
    out = tmp_path / "out"
    found = table(run_study(study, out, devices=["cpu"]))
    assert main(["study", "show", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["trap_power", "[mW]", "largest", "[µm]"]
    value, low, high = (float(found[n][0]) for n in ("largest", "largest_low", "largest_high"))
    assert len(lines) == 4 and lines[1].split() == ["0.1", f"{value:.4g}", f"({low:.3g}", "–", f"{high:.3g})"]
    looked = int(np.sum(found["trials"] > 0))
    assert lines[3].startswith(f"{looked} of 80 points were looked at; all of them: --json") and looked < 60
    assert main(["study", "show", str(out), "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)) == 80


def test_a_table_for_people():
    """A column for each thing that was asked, with its interval or error; bounds of what was not seen; what came."""
    asked = {
        "observables": [
            {"name": "trapped", "kind": "probability", "end": "reached"},
            {"name": "first_passage", "kind": "time"},
            {"name": "outcome", "kind": "choice", "choices": []},
            {"name": "squeeze", "kind": "number", "unit": "pN"},
        ]
    }
    ends = {"reached": (0.25, 6.5), "none": (0.75, math.nan)}
    point = {
        "power": 5.0, "trials": 4, "faults": 0, "trapped": 1.0, "trapped_low": 0.3976, "trapped_high": 1.0,
        "first_passage_rate": 0.0, "first_passage_rate_low": 0.0, "first_passage_rate_high": 1.234,
        "first_passage_events": 0, "first_passage_median": math.nan,
        **{f"outcome_{end}": share for end, (share, _) in ends.items()},
        **{f"squeeze_{end}": mean for end, (_, mean) in ends.items()},
    }  # fmt: skip
    found = xarray.Dataset(
        {n: ("power", [v]) for n, v in point.items() if n != "power"} | {"squeeze": ("power", [3.0], {"units": "pN"})},
        coords={"power": ("power", [5.0], {"units": "mW"})},
    )
    shown = columns({**asked, "observables": [*asked["observables"][:2], *asked["observables"][3:]]}, found)
    assert [heading for heading, _ in shown][:3] == ["power [mW]", "trapped", "first_passage_rate [1/s]"]
    said = {heading: text({**point, "squeeze": 3.0, "squeeze_error": 0.125}) for heading, text in shown}
    assert said == {
        "power [mW]": "5", "trapped": "1 (0.398 – 1)", "first_passage_rate [1/s]": "< 1.23",
        "first_passage_median [s]": "–", "squeeze [pN]": "3 ± 0.12", "trials": "4",
    }  # fmt: skip
    shown = columns(asked, found)
    said = {heading: text(point) for heading, text in shown}
    assert said["outcome [%]"] == "none 75, reached 25" and said["squeeze [pN]"] == "reached 6.5"


@pytest.mark.thorough
def test_analyse_on_escapes(scene, tmp_path, capsys):
    """The rate and its interval at each point, as of any study."""
    axes = {"trap_power": values([0.3, 0.4], unit="mW")}
    study = EscapeStudy(scene, axes=axes, runs=2, branches=16, halved=False, seed=3)
    found = table(run_study(study, tmp_path / "out", devices=["cpu"]))
    assert main(["analyse", str(tmp_path / "out"), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    for n, row in enumerate(rows):
        assert row["runs"] == 2 and row["world_steps"] == found["steps"][n]
        assert row["rate"] == pytest.approx(float(found["escape_rate"][n]))
        assert row["rate_low"] == pytest.approx(float(found["escape_rate_low"][n]))
    assert main(["analyse", str(tmp_path / "out")]) == 0
    assert "rate (1/s)" in (said := capsys.readouterr().out) and len(said.splitlines()) == 3


def test_a_shard_without_a_block(scene, tmp_path, capsys):
    """Said, and nothing is computed."""
    (tmp_path / "s.toml").write_text(
        f'scene = "{scene}"\n[[observable]]\nkind = "trapped"\nuntil = "4 ms"\n[stop]\ntrials = 8\n'
    )
    line = ["study", "run", str(tmp_path / "s.toml"), "--device", "cpu", "-o", str(tmp_path / "out")]
    assert main([*line, "--shard", "2/2"]) == 0
    said = capsys.readouterr().out
    assert "shard 2/2 has none of the 1 block: nothing to compute" in said and "0 of 1 blocks" in said


@pytest.fixture(scope="module")
def three_blocks(scene):
    """A file of a study of three blocks, and what an undisturbed run of it gives."""
    file = scene.parent / "three.toml"
    file.write_text(study_of_a_well(6, 2_048).replace("0.1 s", "4 ms"))
    assert main(["study", "run", str(file), "--device", "cpu", "-o", str(scene.parent / "three")]) == 0
    return file, open_store(scene.parent / "three").read().load()


def at_block(monkeypatch, number: int, do: Callable[[], object]) -> None:
    """Have something happen when the arrays of a block are written and its marker is not."""
    mark = Store.mark

    def marked(store: Store, block: int) -> None:
        if block == number:
            do()
        mark(store, block)

    monkeypatch.setattr(Store, "mark", marked)


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize(
    ("number", "word", "code"), [(signal.SIGINT, "interrupted", 130), (signal.SIGTERM, "terminated", 143)]
)
def test_an_interrupted_study_goes_on(three_blocks, tmp_path, monkeypatch, capsys, number, word, code):
    """Ctrl-C, and SIGTERM as schedulers send it, within the second block: what is kept and why it ended are said, the
    first block is kept, and the same line goes on to the bits of an undisturbed run."""
    file, whole = three_blocks
    line = ["study", "run", str(file), "--device", "cpu", "-o", str(tmp_path / "out")]
    # a shell starts what runs in the background with interrupts ignored
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with monkeypatch.context() as patched:
            at_block(patched, 1, lambda: os.kill(os.getpid(), number))
            assert main(line) == code
    finally:
        signal.signal(signal.SIGINT, before)
    said = [text for text in capsys.readouterr().err.splitlines() if not text.startswith("otwarp: block ")]
    kept = f"otwarp: finished blocks are kept in {tmp_path / 'out'}: the same line goes on"
    assert said == [kept, f"otwarp: {word}"]
    assert open_store(tmp_path / "out").finished() == [0]
    assert main(line) == 0
    assert open_store(tmp_path / "out").read().load().identical(whole)


def test_a_disk_that_fills_up_during_a_study(three_blocks, tmp_path, monkeypatch, capsys):
    """One line, exit code 2, the first block is kept, and with more room the same line goes on to the same bits."""
    file, whole = three_blocks
    line = ["study", "run", str(file), "--device", "cpu", "-o", str(tmp_path / "out")]
    with contextlib.ExitStack() as full, monkeypatch.context() as patched:
        at_block(patched, 1, lambda: full.enter_context(largest_file(1)))
        assert main(line) == 2
    said = [text for text in capsys.readouterr().err.splitlines() if not text.startswith("otwarp: block ")]
    assert len(said) == 1 and said[0].startswith(f"otwarp: {tmp_path / 'out'}/")
    assert said[0].endswith(
        "File too large; allowed: a disk with room, where the same line goes on: finished blocks are kept"
    )
    assert open_store(tmp_path / "out").finished() == [0]
    assert main(line) == 0
    assert open_store(tmp_path / "out").read().load().identical(whole)


@pytest.mark.parametrize("text", ["[]", "3", "{}", '{"version": 1}', '{"version": 1, "scene": {}, "stop": {}}'])
def test_a_study_file_that_is_none(tmp_path, capsys, text):
    """One line, whatever stands there."""
    (tmp_path / "study.json").write_text(text)
    for line in (["study", "show"], ["study", "status"], ["analyse"]):
        assert main([*line, str(tmp_path)]) == 2
        error = capsys.readouterr().err
        assert "study.json: h" in error and "allowed: the file that otwarp study run wrote" in error
        assert error.count("\n") == 1


def test_lines_of_a_log(monkeypatch, capsys):
    """Where nobody looks at a terminal: the first parts, then a line now and then, and the last; with the time left."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with progress.parts("block", "blocks") as say:
        for done in range(40, 241):  # of a run that goes on: what was done before tells nothing of its speed
            say(done, 240)
            now[0] += 3.0
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "otwarp: block 40 of 240"
    assert lines[1].startswith("otwarp: block 41 of 240, 9.9 min left (about ")
    assert lines[2].startswith("otwarp: block 51 of 240, 9.4 min left") and len(lines) == 22
    assert lines[-1] == "otwarp: block 240 of 240"


def test_spelled():
    """No exponents."""
    said = [progress.spelled(t) for t in (0.123, 9.4, 119.0, 125.0, 9_000.0, 200_000.0)]
    assert said == ["0.12 s", "9.4 s", "119 s", "2.1 min", "2.5 h", "2.3 d"]


def test_names_that_a_user_needs():
    """What study files name stands in the package, too."""
    for name in ("delivered", "lost", "trapped", "first_passage", "random", "normal", "sobol", "grid", "values"):
        assert getattr(ot, name) is getattr(ot.studies, name)
