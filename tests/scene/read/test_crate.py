"""A binary stage that USD dies of is refused in one line, by the process that stays alive."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from pxr import Sdf

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.scene.read import crate
from tests.scene.conftest import StageFile

ENDS = {
    "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)": r"crashes on it \(SIGSEGV\)",
    "import sys; sys.exit(3)": "needs more than 8 GiB for [0-9]+ bytes",
    "import sys; sys.exit(4)": "cannot list its prims and properties",
    "import time; time.sleep(60)": "has not read it to the end after 1 s",
    "import sys; print('failed call to posix_madvise(1, 2)', file=sys.stderr)": "reads beyond its end",
}


@pytest.fixture
def binary(stage_file: StageFile) -> Path:
    path = stage_file.folder / "scene.usdc"
    assert Sdf.Layer.FindOrOpen(str(stage_file.write())).Export(str(path))
    return path


@pytest.mark.parametrize("text", ENDS)
def test_what_becomes_of_the_reader(text: str, binary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reader = binary.with_name("reader.py")
    reader.write_text(text)
    monkeypatch.setattr(crate, "READER", reader)
    monkeypatch.setattr(crate, "LEAST_TIME", 1.0 if "sleep" in text else 60.0)
    with pytest.raises(InputError, match=f"scene.usdc: contents = USD {ENDS[text]}: must be a USD file"):
        Scene.load(binary)


def test_a_whole_file_is_read_through_once(binary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    run = crate.subprocess.run
    monkeypatch.setattr(crate.subprocess, "run", lambda *a, **k: calls.append(a) or run(*a, **k))
    for _ in range(2):
        assert len(Scene.load(binary).bodies) == 2
    assert len(calls) == 1
    os.utime(binary, (0, 0))
    Scene.load(binary)
    assert len(calls) == 2


def test_without_an_interpreter_files_are_read_as_they_are(binary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crate.sys, "executable", "/no/such/python")
    assert len(Scene.load(binary).bodies) == 2
