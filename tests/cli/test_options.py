"""Every option of every command with values that make no sense: one line that names it, exit code 2, at once."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from otwarp.cli.main import cli, main
from otwarp.cli.types import Number, OutputPath, name_of

HANDS = str(Path(__file__).parents[2] / "scenes" / "teleop_small.usda")
BEAD = str(Path(__file__).parents[2] / "scenes" / "single_bead.usda")
STUDY = str(Path(__file__).parents[2] / "studies" / "capture.toml")

ROBOT = str(Path(__file__).parents[2] / "scenes" / "strategy_b.usda")
SMOKE = str(Path(__file__).parents[2] / "vision" / "smoke.toml")

FRAME = str(Path(__file__).parents[2] / "docs" / "images" / "vision_stack.png")

NEEDED = {
    "run": [BEAD],
    "info": [BEAD],
    "validate": [BEAD],
    "preview": [BEAD],
    "teleop": [BEAD, "--no-open", "--duration", "0.1"],
    "ros1": [BEAD, "--page", "--no-open", "--duration", "0.1"],
    "ros2": [BEAD, "--page", "--no-open", "--duration", "0.1"],
    "haptics replay": ["absent.mcap"],
    "forces": ["--radius", "1", "--curves"],
    "mobility": [BEAD],
    "decompose": ["absent.stl"],
    "import": ["absent.stl"],
    "view": ["absent"],
    "edit": [BEAD, "--no-open"],
    "reproduce": ["--out", "absent"],
    "analyse": ["absent.nc"],
    "study plan": [STUDY],
    "study run": [STUDY],
    "study show": ["absent"],
    "study export": ["absent"],
    "envs describe": ["otwarp/Navigate-v0"],
    "envs play": [HANDS, "--no-open", "--duration", "0.1"],
    "operators run": [str(Path(HANDS).parent / "cell_delivery.usda")],
    "operators sweep": [str(Path(HANDS).parent / "cell_delivery.usda")],
    "operators show": ["absent"],
    "vision render": [BEAD, "--size", "16x16"],
    "vision train": ["absent"],
    "vision evaluate": ["absent", "absent"],
    "vision export": ["absent"],
    "vision dataset": [SMOKE],
    "vision calibrate": [ROBOT],
    "vision find": [FRAME],
    "vision track": ["absent"],
}
"""What a command needs beside the option under test."""

ANY_TEXT = {"--split", "--camera", "--body", "--node", "--namespace", "--namespaces", "--token", "--name"}
"""Options whose text is a name that is made up."""


def commands(group: click.Group, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """All commands below a group, with the words that call them."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from commands(command, (*words, name))
        else:
            yield (*words, name), command


def nonsense(parameter: click.Parameter) -> list[str]:
    """Values that an option cannot have; `{tmp}` is an empty folder."""
    kind = parameter.type
    if isinstance(kind, Number):
        values = ["many", "nan", "inf", "1e400"]
        values += [f"{kind.low - 1:g}"] if kind.low > -1e300 else []
        values += [f"{kind.low:g}"] if kind.above else []
        return values + ([f"{kind.high * 2:g}"] if kind.high < 1e300 else [])
    if isinstance(kind, OutputPath):
        anywhere = ["{tmp}/file/below", "/proc/otwarp", "{tmp}/" + 300 * "x"]
        anywhere += ["{tmp}/named.xyz"] if kind.endings else []
        return anywhere + (["{tmp}/file"] if kind.folder else ["{tmp}", "{tmp}/absent/file", "/dev/null"])
    if isinstance(kind, click.Choice):
        return ["nonsense"]
    if isinstance(kind, click.Path):
        return ["{tmp}/absent", "{tmp}"] if parameter.opts[-1] != "--checkpoint" else ["{tmp}/absent/file", "{tmp}"]
    return ["nonsense"] if parameter.opts[-1] not in ANY_TEXT else []


def cases() -> Iterator[tuple[str, str, str]]:
    for words, command in commands(cli):
        for parameter in command.params:
            if not getattr(parameter, "is_flag", False):
                for value in nonsense(parameter):
                    yield " ".join(words), name_of(parameter), value


@pytest.mark.parametrize(("command", "option", "value"), cases())
def test_nonsense_is_refused(
    command: str, option: str, value: str, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("in the way")
    value = value.replace("{tmp}", str(tmp_path))
    words = [*command.split(), *NEEDED.get(command, [])]
    if option in ("--left", "--right", "--config"):
        words[1 + command.count(" ")] = HANDS
    if option.startswith("--"):
        words += [option, value]
    else:
        words = [*command.split(), value]
    start = time.process_time()
    code = main(words)
    took = time.process_time() - start
    out, error = capfd.readouterr()
    assert (code, out) == (2, "")
    assert error.count("\n") == 1 and error.startswith("error: " if words[0] == "validate" else "otwarp: ")
    assert option.strip("-") in error or value in error
    assert took < 5.0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]
