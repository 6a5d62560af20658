"""Which trainings are done anew, and where they were measured."""

from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("gymnasium")

from benchmarks.envs_learning import is_whole, places


def test_a_training_that_was_killed_while_its_result_was_written_is_done_anew(tmp_path: Path) -> None:
    file = tmp_path / "result.json"
    assert not is_whole(file)
    for text, whole in (('{"succ', False), ('{"success": 1.0}', False), ('{"success": 1.0, "where": "here"}', True)):
        file.write_text(text, encoding="utf-8")
        assert is_whole(file) is whole


def test_machines_of_seeds_are_named_where_they_differ() -> None:
    """A line for each commit and machine; what alone differs on one machine is the load."""
    here, there = "Commit 5db1fb96+, AMD EPYC, 2 cores, load {} at the end.", "Commit 9eff8391, NVIDIA H200, 32 cores."
    assert places({0: here.format("4.9"), 1: here.format("0.5")}) == here.format("4.9, 0.5")
    assert places({0: there, 1: there}) == there
    found = places({0: here.format("4.9"), 1: there, 2: here.format("1")})
    assert found.splitlines() == [f"Seeds 0, 2: {here.format('4.9, 1')}  ", f"Seed 1: {there}"]
