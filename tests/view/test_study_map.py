"""The map of a study on the page, and the trial of a point that is clicked on."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from otwarp.cli.main import EXIT_BAD_INPUT, main
from otwarp.errors import InputError
from otwarp.studies.engines.run import run_study
from otwarp.studies.file import load_study
from otwarp.studies.rerun import rerun, stored_study
from otwarp.studies.store import Store, open_store
from otwarp.view.curves import charts
from otwarp.view.study_map import RAMP, StudyMap, ramp
from otwarp.view.trial import TrialSource
from tests.studies.scenes import bead_in_a_well, study_of_a_well
from tests.teleop.page.browser import ARTIFACTS, browser
from tests.view.test_browser import PATIENCE, WIDE, accessible, comes, opened, page_of, share

pytest.importorskip("zarr")

FILE = study_of_a_well(3, 24, starts="0, 0.1, 0.3, 0.35")


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    folder = tmp_path_factory.mktemp("map")
    file = folder / "well.toml"
    bead_in_a_well(folder)
    file.write_text(FILE, encoding="utf-8")
    run_study(load_study(file), folder / "out", devices=["cpu"])
    return open_store(folder / "out")


def test_the_map_has_a_cell_for_every_point(store: Store):
    found = StudyMap(store, stored_study(store))
    assert found.shape == (3, 4) and "trapped" in found.observables and not any("_low" in n for n in found.observables)
    text = found.grid("trapped", {}, 6)
    points = [int(n) for n in re.findall(r'data-otwarp-set="(\d+)"', text)]
    assert points == [8, 9, 10, 11, 4, 5, 6, 7, 0, 1, 2, 3]  # the first dimension goes upwards
    assert text.count('aria-pressed="true"') == 1
    assert found.said(6) == (("trap_power", "0.6 mW"), (found.dims[1], "0.3 µm")) and found.trials(6) == 24
    with store.read() as raw:
        held = np.mean(raw["end"].values[1, 2] == 0)
    assert f"0.3 µm: {held:.3g}, 24 trials" in text
    assert 0 <= found.first() < 12


def test_colours_go_from_the_smallest_to_the_largest():
    assert [ramp(x) for x in (-1.0, 0.0, 0.5, 1.0, 2.0)] == [RAMP[0], RAMP[0], RAMP[1], RAMP[2], RAMP[2]]


def test_a_trial_is_played_back(store: Store):
    study = stored_study(store)
    found = rerun(store, study, 3, 0)
    source = TrialSource(found, "a trial")
    assert dict(source.about)["the study's own bits"] == "yes"
    frame = source.frame(0)
    assert frame.position[0, 0] == pytest.approx(0.35, abs=1e-6) and frame.time == 0.0
    keys = [chart.key for chart in charts(source)]
    assert keys == ["distance", "speed"]  # nothing can touch anything


def test_what_is_no_study_of_this_version_is_refused(store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    other = tmp_path / "other"
    other.mkdir()
    (other / "study.json").write_text((store.folder / "study.json").read_text().replace('"version": 1', '"version": 2'))
    assert main(["view", str(other), "--no-open"]) == EXIT_BAD_INPUT
    assert "version = 2: must be 1" in capsys.readouterr().err
    assert main(["view", str(store.folder), str(store.folder), "--no-open"]) == EXIT_BAD_INPUT
    assert "a study alone, or two runs" in capsys.readouterr().err
    folder = tmp_path / "nothing"
    file = store.folder.parent / "well.toml"
    study = load_study(file)
    from otwarp.studies.engines.run import prepare

    prepare(study, folder)
    with pytest.raises(InputError, match="no block is done yet"):
        StudyMap(open_store(folder), study)


def test_a_click_on_the_map_shows_a_trial(store: Store):
    with browser() as engine, page_of("view", str(store.folder)) as url:
        window, errors = opened(engine, url, WIDE)
        window.get_by_text("the bits of the study's own trial").wait_for(timeout=PATIENCE)
        window.locator('[data-otwarp-set="7"]').click()
        window.get_by_text("otwarp · trial 0 of point 7").wait_for(timeout=PATIENCE)
        window.get_by_text("the bits of the study's own trial").wait_for(timeout=PATIENCE)
        assert window.locator('[data-otwarp-set="7"]').get_attribute("aria-pressed") == "true"
        window.locator("canvas[data-engine]").click(position={"x": 60, "y": 500})
        window.keyboard.press("End")
        comes(window, lambda: share(window) == 1.0)
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        window.screenshot(path=ARTIFACTS / "study_map.png")
        assert accessible(window) and errors == []
