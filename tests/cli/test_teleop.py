"""`otwarp teleop`, `ros1` and `ros2` as typed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from otwarp.cli.main import main

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SMALL = str(SCENES / "teleop_small.usda")
HOLD = "virtual:hold,at=0/0/0"
QUIET = ["--no-page", "--budget", "off", "--device", "cpu"]


@pytest.mark.thorough
def test_a_session_without_a_page(capfd):
    hands = ["--left", "virtual:circle,radius=0.005", "--right", "virtual:hold,at=0/0/0", "--arm"]
    assert main(["teleop", SMALL, *QUIET, *hands, "--duration", "0.6", "--json"]) == 0
    out, err = capfd.readouterr()
    report = json.loads(out)
    assert report["simulated"] + report["slipped"] == pytest.approx(report["wall"], abs=0.1)
    assert report["frames"] >= 1 and report["servo"]["cycles"] >= 1 and report["budget"] is None
    assert [hand["name"] for hand in report["hands"]] == ["left", "right"]
    assert [hand["losses"] for hand in report["hands"]] == [0, 0] and not err


@pytest.mark.parametrize(
    ("command", "options", "line"),
    [
        ("teleop", ["--left", "teapot"], "device 'teapot': unknown kind 'teapot'; must be one of "),
        ("teleop", ["--left", "mouse"], "--left is 'mouse'; allowed with the page, which has the mouse"),
        ("teleop", ["--left", "virtual:circle,radius=-1"], "radius = -1 must be a number from 0"),
        ("teleop", ["--left", "replay:absent.csv"], "absent.csv: cannot be read"),
        ("teleop", ["--left", "openhaptics:L", "--right", "openhaptics:L"], "both hands name it"),
        ("teleop", ["--speed", "0"], "--speed is 0; allowed: 0.01 to 10"),
        ("teleop", ["--rate", "1"], "--rate is 1; allowed: 10 to 1000"),
        ("teleop", ["--left", "virtual:hold,at=0/0/0", "--servo-rate", "1"], "chain.rate is 1.0; allowed: 100 to"),
        ("teleop", ["--budget", "plenty"], "plenty"),
        ("teleop", ["--duration", "-1"], "--duration is -1; allowed: finite, above 0 s"),
        (
            "teleop",
            ["--left", "virtual:hold,at=0/0/0", "--config", "absent.json"],
            "--config absent.json: cannot be read",
        ),
        ("teleop", ["--arm"], "--arm is given without a hand; allowed with --left or --right"),
        ("teleop", ["--force-gain", "0.1"], "--force-gain is given without a hand"),
        (
            "teleop",
            ["--left", "virtual:hold,at=0/0/0", "--force-gain", "-1"],
            "--force-gain is -1; allowed: finite, 0",
        ),
        ("teleop", ["--seed", "-1"], "--seed is -1; allowed: a whole number, 0 to 4294967295"),
        ("teleop", ["--record", "no/such/folder/take.mcap"], "no/such/folder"),
        ("teleop", ["--record", "take.txt"], "take.txt"),
        ("teleop", ["--record", "/proc/x.mcap"], "recording is /proc/x.mcap"),
        ("ros1", ["--master", "http://127.0.0.1:9/"], "http://127.0.0.1:9/"),
        ("ros1", ["--topic-rate", "0"], "--topic-rate is 0; allowed: 1 to 1000 Hz"),
        ("ros1", ["--namespaces", "/a"], "namespaces is '/a'; allowed: none, or two different ones, of"),
        ("ros2", ["--domain", "500"], "--domain is 500; allowed: a whole number, 0 to 232"),
        ("ros2", ["--control-rate", "0"], "--control-rate is 0; allowed: 0.1 to 1000 Hz"),
        ("ros2", ["--node", "7up"], "7up"),
    ],
    ids=lambda v: v[0].strip("-") if isinstance(v, list) else "",
)
def test_bad_input_is_one_line_and_nothing_starts(command, options, line, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("otwarp.teleop.session.LiveLoop", None)  # its kernels would take longer than reading a line
    quiet = [option for option in QUIET if option not in options]
    if "--budget" in options:
        quiet = ["--no-page", "--device", "cpu"]
    assert main([command, SMALL, *quiet, "--duration", "0.2", *options]) == 2
    out, err = capfd.readouterr()
    assert line in err and err.count("\n") == 1 and err.startswith("otwarp: ") and not out
    assert not list(tmp_path.iterdir())


def test_a_scene_whose_traps_no_hand_has(capfd):
    scene = str(SCENES / "single_bead.usda")
    assert main(["teleop", scene, *QUIET, "--left", "virtual:hold,at=0/0/0"]) == 2
    assert "no trap has ot:trap:hand = 'left'; allowed: a hand that moves a trap" in capfd.readouterr().err
    assert main(["ros2", scene, *QUIET, "--duration", "0.2"]) == 2
    assert "allowed: two hands that hold a robot" in capfd.readouterr().err
