"""The benchmark of perception errors draws its map and writes its tables: two operators, a few cells."""

from benchmarks import perception_error
from benchmarks.perception_error import BLOCK, NETWORKS, grid, our_errors
from otwarp.operators.perception.errors import Perception


def test_errors_of_our_networks_are_those_of_their_page():
    """Of whole images and blocks of focus, in µm; other tables and the CPU's block have rows of the same names."""
    table = """| network, split | depth, normalised | depth [µm] |
|---|---:|---:|
| small, pose, random | 0.05 ± 0.01 | 0.153 |
| resnet18, focus_blocks | 0.06 | – |
| resnet18, pose, focus_blocks | 0.0288 | 0.38 |
| small, pose, focus_blocks | 0.0294 | 0.266 ± 0.01 |

| network | images/s |
|---|---:|
| small, pose, focus_blocks | 597 |
"""
    page = f"{table.replace('0.266', '1.06')}\n{BLOCK[0]}\n{table}\n{BLOCK[1]}\n"
    expected = {"small (ours, blocks of focus)": 0.266, "ResNet18 (ours, blocks of focus)": 0.38}
    assert our_errors(page) == expected
    assert our_errors(NETWORKS.read_text(encoding="utf-8")).keys() == expected.keys()


def test_a_report_of_a_tiny_sweep(tmp_path, monkeypatch):
    small = {
        "weak": {"axes": grid(0, 50, depth=(0.0, 0.2))},
        "chain": {"axes": grid(0, 50, depth=(0.0, 0.2))},
        "pose": {"axes": {"tilt_error": (0.0, 5.0)}},
        "late_pose": {"axes": {"delay": (0.05,), "tilt_error": (5.0, 10.0)}},
        "late_lateral": {"axes": {"delay": (0.05,), "lateral_error": (0.0, 0.1)}},
        "unstamped": {"axes": grid(50), "base": Perception(stamped=False)},
        "slow": {"axes": grid(0, depth=(0.2,)), "base": Perception(correlation=0.5)},
        "lateral": {"axes": grid(0), "base": Perception(lateral_error=0.2)},
        "slow_lateral": {"axes": grid(0), "base": Perception(lateral_error=0.2, correlation=0.5)},
        "eyes": {"axes": grid(50), "base": Perception(eyes="twin")},
    }
    assert small.keys() == perception_error.SWEEPS.keys()
    monkeypatch.setattr(perception_error, "SWEEPS", small)
    monkeypatch.setattr(perception_error, "OUT", tmp_path)
    text = perception_error.report("cpu", 2, 1, tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000
    assert "2 simulated operators in each of 4 cells" in text
    assert "| delay ms: 50, depth error µm: 0.2 |" in text
    assert text.count("| no haptics |") == 3
    assert "| tilt error °: 10 |" in text and "| error along x and y µm: 0.1 |" in text
