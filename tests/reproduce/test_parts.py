"""An item that is computed in several calls: whose, how long, and refused where the code is another."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.reproduce import parts
from otwarp.reproduce.code import Code, code_here
from otwarp.reproduce.item import Figure, Request, Result, Table, Unavailable
from otwarp.reproduce.registry import ITEMS
from otwarp.reproduce.runner import done_in, reproduce

KILLED = """
import os, signal, sys, time
from dataclasses import replace
from pathlib import Path
from otwarp.reproduce import parts
from otwarp.reproduce.runner import reproduce

parts.EVERY = 0.05

def kill(line):
    if line.startswith("force_curves: "):
        work = Path(sys.argv[1]) / "work" / "force_curves"
        (work / "kept").touch()
        while parts.read_parts(work / parts.PARTS)[0].seconds <= 0.4:
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGKILL)

reproduce(sys.argv[1], names=("force_curves",), quick=True, device="cpu", say=kill)
"""


@pytest.fixture(scope="module")
def killed_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("killed")
    done = subprocess.run([sys.executable, "-c", KILLED, str(out)], env=os.environ, capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    return out


@pytest.fixture
def killed(killed_once: Path, tmp_path: Path) -> Path:
    """A report whose item was killed while it was computed."""
    return shutil.copytree(killed_once, tmp_path, dirs_exist_ok=True)


def quickly(monkeypatch: pytest.MonkeyPatch, run) -> None:
    """Let something else compute the item that was killed."""
    one = ITEMS["force_curves"]
    monkeypatch.setitem(ITEMS, one.name, replace(one, run=run))


def nothing(request: Request) -> Result:
    """An item that has as many figures and tables as it should, and nothing in them."""
    (request.folder / "none.png").write_bytes(b"")
    one, empty = ITEMS["force_curves"], Table(title="", head=("",), rows=())
    return Result(
        comparisons=(),
        definition="",
        difference="",
        figures=(Figure(file="none.png", caption=""),) * one.figures,
        tables=(empty,) * (one.tables - 1),
    )


@pytest.mark.thorough
def test_a_part_that_is_killed_counts_until_then(killed: Path, monkeypatch):
    (first,) = parts.read_parts(killed / "work" / "force_curves" / parts.PARTS)
    assert first.seconds > 0.4 and first.device == "cpu"
    quickly(monkeypatch, nothing)
    reproduce(killed, names=("force_curves",), quick=True, device="cpu")
    (one,) = done_in(killed)[1]
    assert one.parts[0] == first and len(one.parts) == 2 and one.seconds > first.seconds
    assert one.parts[0].call < one.parts[1].call
    page = (killed / "report.html").read_text(encoding="utf-8")
    assert "Computed in 2 calls of the command" in page and "Force curves and their fits (2)" in page
    assert not (killed / "work" / "force_curves").exists()


@pytest.mark.thorough
def test_an_item_goes_on_with_the_code_that_began_it_alone(killed: Path, monkeypatch):
    work = killed / "work" / "force_curves"
    said = json.loads((work / parts.PARTS).read_text())
    said[0]["code"] = {"commit": "0ldc0de0", "digest": "another"}
    (work / parts.PARTS).write_text(json.dumps(said))
    quickly(monkeypatch, nothing)
    with pytest.raises(InputError, match=r"work/force_curves: was begun by other code .*0ldc0de0.*without that folder"):
        reproduce(killed, names=("force_curves",), quick=True, device="cpu")
    assert (work / "kept").exists()
    shutil.rmtree(work)
    assert len(reproduce(killed, names=("force_curves",), quick=True, device="cpu").done[0].parts) == 1


@pytest.mark.thorough
def test_another_device_is_said(killed: Path, monkeypatch):
    work = killed / "work" / "force_curves"
    said = json.loads((work / parts.PARTS).read_text())
    said[0] |= {"device": "cuda:0", "machine": "card"}
    (work / parts.PARTS).write_text(json.dumps(said))
    quickly(monkeypatch, nothing)
    (one,) = reproduce(killed, names=("force_curves",), quick=True, device="cpu").done
    assert one.device == "cuda:0, cpu" and parts.where(one.parts).count("card") == 1


@pytest.mark.thorough
def test_what_turns_out_to_be_unavailable_is_no_part(killed: Path, monkeypatch):
    before = parts.read_parts(killed / "work" / "force_curves" / parts.PARTS)

    def without(request: Request) -> Result:
        raise Unavailable("it lacks something")

    quickly(monkeypatch, without)
    assert reproduce(killed, names=("force_curves",), quick=True, device="cpu").missing
    assert parts.read_parts(killed / "work" / "force_curves" / parts.PARTS) == before
    assert (killed / "work" / "force_curves" / "kept").exists()


def test_remains_of_an_item_that_is_done_go(tmp_path: Path):
    reproduce(tmp_path, names=("contract",), quick=True, device="cpu")
    (tmp_path / "work" / "contract").mkdir(parents=True)
    reproduce(tmp_path, names=("contract",), quick=True, device="cpu")
    assert not (tmp_path / "work" / "contract").exists()


def test_damaged_parts_are_named(tmp_path: Path):
    (tmp_path / parts.PARTS).write_text("[{}]")
    with pytest.raises(InputError, match=r"parts\.json: contents cannot be read"):
        parts.read_parts(tmp_path / parts.PARTS)


def test_scenes_belong_to_the_code_and_its_commit_may_be_told(tmp_path: Path, monkeypatch):
    monkeypatch.setenv("OTWARP_COMMIT", "12345678")
    file = tmp_path / "a.usda"
    file.write_text("one")
    first = code_here([file])
    assert first.commit == "12345678" and first == code_here([file])
    file.write_text("other")
    assert code_here([file]).digest != first.digest
    assert Code(commit="", digest="0123").said() == "commit not known, files 0123"
