"""Which trainings are done anew."""

from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("gymnasium")

from benchmarks.envs_learning import is_whole


def test_a_training_that_was_killed_while_its_result_was_written_is_done_anew(tmp_path: Path) -> None:
    file = tmp_path / "result.json"
    assert not is_whole(file)
    for text, whole in (('{"succ', False), ('{"success": 1.0}', False), ('{"success": 1.0, "where": "here"}', True)):
        file.write_text(text, encoding="utf-8")
        assert is_whole(file) is whole
