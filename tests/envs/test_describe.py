"""Tables of environments: the published page is what the command writes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("gymnasium")

import gymnasium
from pxr import UsdUtils

from otwarp.cli.main import main
from otwarp.envs.describe import page
from otwarp.envs.registration import TASKS, task_named, task_of

PAGE = Path(__file__).resolve().parents[2] / "docs" / "environments_tables.md"


def test_the_published_tables_are_those_of_the_tasks():
    assert PAGE.read_text(encoding="utf-8") == page(task_of(n) for n in TASKS), f"otwarp envs describe -o {PAGE.name}"


def test_what_is_described_is_what_there_is(capsys):
    assert main(["envs", "describe", "otwarp/Navigate-v0", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in shown["rewards"]] == [t.name for t in task_of("otwarp/Navigate-v0").rewards]
    ends = {row["name"]: row["meaning"] for row in shown["ends"]}
    assert ends["reached"] == "A body is within 3 µm of the goal (body: robot)."
    seen = {row["name"]: row["meaning"] for row in shown["observations"]}
    assert seen["pillar_2.x"].endswith(" of an obstacle's surface (body: robot, obstacle: pillar_2).")
    assert main(["envs", "list"]) == 0
    assert all(name in capsys.readouterr().out for name in list(TASKS)[:1])
    assert main(["envs", "describe", "otwarp/Fly-v0"]) == 2
    assert "allowed: otwarp/Navigate-v0" in capsys.readouterr().err


@pytest.mark.thorough
def test_of_ot_gym_its_own_numbers_and_choices_are_described(capsys):
    name = "otwarp/CellDeliveryOTGym-v0"
    env = gymnasium.make(name)
    assert main(["envs", "describe", name, "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert len(shown["observations"]) == env.observation_space.shape[0] and len(shown["actions"]) == env.action_space.n
    assert main(["envs", "describe", name]) == 0
    out = capsys.readouterr().out
    assert "off_middle" in out and "4.95 µm" in out and "from 0.05 to 10 pN" in out and "velocity" not in out


def test_options_of_a_task_are_given_by_name(capsys):
    name = "otwarp/Orient-v0"
    both = ["--option", "strategy=B", "--option", "image_size=84,60", "--option", "observation=both"]
    assert main(["envs", "describe", name, *both]) == 0
    out = capsys.readouterr().out
    assert "left.power" in out and "84 × 60 pixels is observed beside" in out
    for bad, said in (
        ("strategy=C", "option strategy of otwarp/Orient-v0 is 'C'; allowed: A, B"),
        ("colour=red", "NAME one of strategy, "),
        ("hands=two", "NAME one of strategy, "),
        ("strategy", "allowed: NAME=VALUE"),
        ("time_limit=nan", "allowed: a finite number"),
        ("image_size=84", "allowed: 2 whole numbers parted by commas"),
        ("image_follows=1", "allowed: true or false"),
        ("rate=-1", "rate of task otwarp/Orient-v0 is -1.0; allowed: a number from 0.1 to 10000 Hz"),
    ):
        for command in (["describe"], ["play", "--policy", "still"]):
            assert main(["envs", *command, name, "--option", bad]) == 2
            error = capsys.readouterr().err
            assert said in error and error.count("\n") == 1, error
    assert main(["envs", "describe", "--option", "strategy=B"]) == 2
    assert "--option without NAME" in capsys.readouterr().err


def test_a_scene_is_described_by_its_name_or_file(capsys, tmp_path: Path):
    shown = []
    for name in ("teleop_small", "scenes/teleop_small.usda"):
        assert main(["envs", "describe", name, "--json"]) == 0
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1]
    assert main(["envs", "describe", "nothing"]) == 2
    assert "'nothing' is unknown; allowed: otwarp/Navigate-v0" in capsys.readouterr().err
    packed = tmp_path / "small.usdz"
    assert UsdUtils.CreateNewUsdzPackage("scenes/teleop_small.usda", str(packed))
    assert task_named(str(packed)).hands == task_named("teleop_small").hands


@pytest.mark.thorough
def test_a_policy_plays_an_episode(capsys):
    assert main(["envs", "play", "otwarp/Navigate-v0", "--policy", "still"]) == 0
    assert "seed 0: failure" in capsys.readouterr().out


@pytest.mark.thorough
def test_what_a_policy_did_is_an_object_for_a_program(capsys):
    short = ["--option", "time_limit=0.1", "--json", "--device", "cpu", "--seed", "3"]
    assert main(["envs", "play", "otwarp/Navigate-v0", "--policy", "still", *short]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["seed"] == 3 and told["end"] == "out of time" and told["seconds"] == pytest.approx(0.1)
    assert not told["success"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--policy", "still", "--device", "bogus"], "bogus"),
        (
            ["--policy", "expert", "--option", "action=power"],
            "expert of otwarp/Navigate-v0 acts by 2 numbers, an action has 1 here; allowed: the task's own actions",
        ),
        (["--policy", "still", "--left", "mouse"], "--left with --policy, which runs no session; allowed: --seed"),
        (["--policy", "still", "--speed", "1"], "--speed with --policy"),
        (["--policy", "still", "--duration", "1"], "--duration with --policy"),
        (["--policy", "still", "--no-page"], "--page with --policy"),
        (["--option", "time_limit=1"], "--option time_limit=1 without --policy"),
    ],
)
def test_options_that_would_do_nothing_are_refused(given, said, capsys):
    assert main(["envs", "play", "otwarp/Navigate-v0", *given]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1, error


@pytest.mark.thorough
@pytest.mark.parametrize("ending", ["gif", "mp4"])
def test_an_episode_is_filmed(ending: str, tmp_path: Path, capsys):
    if ending == "mp4":
        pytest.importorskip("imageio_ffmpeg")
    file = tmp_path / f"episode.{ending}"
    short = ["--option", "time_limit=0.2", "--policy", "still"]
    assert main(["envs", "play", "otwarp/Push-v0", *short, "--movie", str(file)]) == 0
    assert f"wrote {file} (3 pictures)" in capsys.readouterr().out and file.stat().st_size > 1000
    assert main(["envs", "play", "otwarp/Push-v0", *short, "--movie", str(file.with_suffix(".avi"))]) == 2
    assert "suffix = .avi; allowed: .gif, .mp4, .webm" in capsys.readouterr().err
