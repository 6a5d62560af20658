"""The benchmark of perception errors draws its map and writes its tables: two operators, a few cells."""

from benchmarks import perception_error
from benchmarks.perception_error import NETWORKS, grid, our_errors
from otwarp.operators.perception.errors import Perception


def test_errors_of_our_networks_are_those_of_their_page():
    """Means over seeds of the random split, of the column in µm; other tables have rows of the same names."""
    page = """| network, split | depth, normalised | depth [µm] |
|---|---:|---:|
| small, random | 0.05 ± 0.01 | 0.318 ± 0.028 |
| resnet18, random | 0.08 ± 0.01 | 0.513 ± 0.043 |
| small, focus_blocks | 0.16 ± 0.02 | 1.06 ± 0.085 |
"""
    expected = {"small (ours)": 0.318, "ResNet18 (ours)": 0.513}
    assert our_errors(page) == our_errors(f"{page}\n| small, random | 597 |\n") == expected
    assert our_errors(NETWORKS.read_text(encoding="utf-8")).keys() == expected.keys()


def test_a_report_of_a_tiny_sweep(tmp_path, monkeypatch):
    small = {
        "weak": {"axes": grid(0, 50, depth=(0.0, 0.2))},
        "chain": {"axes": grid(0, 50, depth=(0.0, 0.2))},
        "pose": {"axes": {"tilt_error": (0.0, 5.0)}},
        "unstamped": {"axes": grid(50), "base": Perception(stamped=False)},
        "slow": {"axes": grid(0, depth=(0.2,)), "base": Perception(correlation=0.5)},
        "lateral": {"axes": grid(0), "base": Perception(lateral_error=0.2)},
        "slow_lateral": {"axes": grid(0), "base": Perception(lateral_error=0.2, correlation=0.5)},
        "eyes": {"axes": grid(50), "base": Perception(eyes="twin")},
    }
    monkeypatch.setattr(perception_error, "SWEEPS", small)
    monkeypatch.setattr(perception_error, "OUT", tmp_path)
    text = perception_error.report("cpu", 2, 1, tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000
    assert "2 simulated operators in each of 4 cells" in text
    assert "| delay ms: 50, depth error µm: 0.2 |" in text
    assert text.count("| no haptics |") == 3
