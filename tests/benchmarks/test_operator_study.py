"""The page of simulated operators says of how many rows its Sobol indices are, and with what errors."""

from functools import partial

from benchmarks import operator_study
from tests.operators.work import study


def test_indices_stand_with_their_rows_and_errors(tmp_path, monkeypatch):
    """Of two rows and trials of 50 ms."""
    monkeypatch.setattr(operator_study, "OUT", tmp_path)
    monkeypatch.setattr(operator_study, "study", partial(study, duration=0.05))
    text = operator_study.sobol_text("cpu", 2)
    assert text.startswith("Sobol indices of 2 rows of Saltelli's points, 40 simulated operators")
    lines = [line for line in text.splitlines() if line.startswith("- Sobol, contact with − without")]
    assert len(lines) == operator_study.SHOWN_INDICES and all(line.count("±") == 2 for line in lines)


def test_both_parts_have_markers_on_the_page():
    page = operator_study.PAGE.read_text(encoding="utf-8")
    for begin, end in operator_study.PARTS.values():
        assert page.count(begin) == page.count(end) == 1
