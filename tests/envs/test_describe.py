"""Tables of environments: the published page is what the command writes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("gymnasium")

import gymnasium

from otwarp.cli.main import main
from otwarp.envs.describe import page
from otwarp.envs.registration import TASKS, task_of

PAGE = Path(__file__).resolve().parents[2] / "docs" / "environments_tables.md"


def test_the_published_tables_are_those_of_the_tasks():
    assert PAGE.read_text(encoding="utf-8") == page(task_of(n) for n in TASKS), f"otwarp envs describe -o {PAGE.name}"


def test_what_is_described_is_what_there_is(capsys):
    assert main(["envs", "describe", "otwarp/Navigate-v0", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in shown["rewards"]] == [t.name for t in task_of("otwarp/Navigate-v0").rewards]
    assert main(["envs", "list"]) == 0
    assert all(name in capsys.readouterr().out for name in list(TASKS)[:1])
    assert main(["envs", "describe", "otwarp/Fly-v0"]) == 2
    assert "allowed: otwarp/Navigate-v0" in capsys.readouterr().err


def test_of_ot_gym_its_own_numbers_and_choices_are_described(capsys):
    name = "otwarp/CellDeliveryOTGym-v0"
    env = gymnasium.make(name)
    assert main(["envs", "describe", name, "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert len(shown["observations"]) == env.observation_space.shape[0] and len(shown["actions"]) == env.action_space.n
    assert main(["envs", "describe", name]) == 0
    out = capsys.readouterr().out
    assert "off_middle" in out and "4.95 µm" in out and "[pN]" in out and "velocity" not in out


def test_a_policy_plays_an_episode(capsys):
    assert main(["envs", "play", "otwarp/Navigate-v0", "--policy", "still"]) == 0
    assert "seed 0: failure" in capsys.readouterr().out
